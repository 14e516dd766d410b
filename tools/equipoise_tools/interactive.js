// The report's plots: one time axis for all, zoomed together by mouse or by fingers.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const numbers = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const holder = document.getElementById("plots");
  const t = numbers(data.t), first = t[0], last = t[t.length - 1];
  const plots = [];
  window.report = { plots, get range() { const { min, max } = plots[0].scales.x; return [min, max]; } };

  const width = () => (holder.clientWidth > 900 ? (holder.clientWidth - 16) / 2 : holder.clientWidth);
  function zoom(min, max) {
    const least = 0.02; // s: a few ticks
    if (max - min < least) { const middle = (min + max) / 2; min = middle - least / 2; max = middle + least / 2; }
    min = Math.max(first, min);
    max = Math.min(last, max);
    if (max > min) for (const plot of plots) plot.setScale("x", { min, max });
  }
  const all = () => zoom(first, last);

  /** Two fingers zoom, one moves sideways what has been zoomed; up and down scrolls the page. */
  function fingers(plot) {
    const down = new Map();
    let from = null;
    const at = (event) => event.clientX - plot.over.getBoundingClientRect().left;
    const begin = () => {
      const { min, max } = plot.scales.x;
      from = { min, max, x: [...down.values()], width: plot.over.clientWidth };
    };
    plot.over.style.touchAction = "pan-y";
    plot.over.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "touch") return;
      down.set(event.pointerId, at(event));
      begin();
    });
    plot.over.addEventListener("pointermove", (event) => {
      if (!down.has(event.pointerId)) return;
      down.set(event.pointerId, at(event));
      const now = [...down.values()], span = (from.max - from.min) / from.width;
      if (now.length === 1) {
        const shift = Math.max(first - from.min, Math.min(last - from.max, (from.x[0] - now[0]) * span));
        zoom(from.min + shift, from.max + shift);
      } else {
        const [a, b] = from.x.slice(0, 2).sort((p, q) => p - q), [c, d] = now.slice(0, 2).sort((p, q) => p - q);
        const factor = (b - a) / Math.max(1, d - c); // what was under the fingers stays there
        const min = from.min + a * span - c * span * factor;
        zoom(min, min + from.width * span * factor);
      }
    });
    for (const end of ["pointerup", "pointercancel"])
      plot.over.addEventListener(end, (event) => { if (down.delete(event.pointerId) && down.size) begin(); });
  }

  /** Behind the curves: where it was asked to drive. */
  function shade(plot) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.fillStyle = "#0072b212";
    for (const [from, to] of data.driving) {
      const a = Math.max(plot.valToPos(from, "x", true), bbox.left), b = Math.min(plot.valToPos(to, "x", true), bbox.left + bbox.width);
      if (b > a) ctx.fillRect(a, bbox.top, b - a, bbox.height);
    }
    ctx.restore();
  }

  for (const { title, unit, series } of data.plots) {
    const options = {
      title: `${title} (${unit})`, width: width(), height: 230,
      scales: { x: { time: false } },
      cursor: { sync: { key: "report" }, drag: { x: true, y: false, setScale: false }, bind: { dblclick: () => () => { all(); return null; } } },
      hooks: {
        drawClear: [shade],
        setSelect: [(plot) => {
          const { left, width: wide } = plot.select;
          if (wide > 0) {
            zoom(plot.posToVal(left, "x"), plot.posToVal(left + wide, "x"));
            plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
          }
        }],
      },
      axes: [{ size: 32 }, { size: 56 }],
      series: [{ label: "t (s)", value: (u, v) => (v == null ? "" : v.toFixed(3)) },
        ...series.map(({ label, colour, dash }) => ({ label, stroke: colour, width: 1.3, dash: dash ? [6, 4] : undefined,
          spanGaps: false, value: (u, v) => (v == null || Number.isNaN(v) ? "" : v.toPrecision(4)) }))],
    };
    // What is not known is a gap.
    const columns = series.map(({ values }) => Array.from(numbers(values), (v) => (Number.isNaN(v) ? null : v)));
    const plot = new uPlot(options, [t, ...columns], holder);
    fingers(plot);
    plots.push(plot);
  }
  addEventListener("resize", () => plots.forEach((plot) => plot.setSize({ width: width(), height: 230 })));
})();
