// Live plots with a common cursor over a bounded history.
import uPlot from "/uPlot.esm.js";

const CAPACITY = 3000; // frames: a minute at 50 Hz
const WINDOW_S = 20;
const COLOURS = { blue: "#0072b2", red: "#d55e00", green: "#009e73", pink: "#cc79a7", yellow: "#e69f00", black: "#888" };
const deg = (r) => r * 180 / Math.PI, turns = (r) => r / (2 * Math.PI);

/** Columns of numbers; the oldest go when it is full. */
export class History {
  constructor(columns) {
    this.columns = Array.from({ length: columns }, () => new Float64Array(2 * CAPACITY));
    this.clear();
  }
  clear() { this.start = this.end = 0; }
  get length() { return this.end - this.start; }
  push(row) {
    if (this.end === 2 * CAPACITY) {
      for (const column of this.columns) column.copyWithin(0, this.end - CAPACITY + 1, this.end);
      this.start = 0;
      this.end = CAPACITY - 1;
    }
    row.forEach((value, i) => { this.columns[i][this.end] = value; });
    this.end++;
    if (this.length > CAPACITY) this.start++;
  }
  last() { return this.length ? this.columns[0][this.end - 1] : NaN; }
  view(indices) { return indices.map((i) => this.columns[i].subarray(this.start, this.end)); }
}

const SIGNALS = { t: 0, tiltX: 1, tiltY: 2, refX: 3, refY: 4, speedX: 5, speedY: 6, refSpeedX: 7, refSpeedY: 8,
  yaw: 9, wantedYaw: 10, duty0: 11, duty1: 12, duty2: 13, duty3: 14, battery: 15, nis: 16, ratio: 17, runnerUp: 18, bound: 19,
  thenX: 20, thenY: 21, thenNis: 22, thenRatio: 23 };

/** cm/s, forward and to the left of the nose: a ball that rolls about y goes along x. */
const speeds = { mbbr: (s, radius) => [100 * radius * s.phi_dot_rad_s[1], -100 * radius * s.phi_dot_rad_s[0]],
  mip: (s, radius) => [100 * radius * s.phi_dot_rad_s[0], NaN] };

function row(frame, robot, radius) {
  const s = frame.EQUIPOISE_STATE, r = frame.EQUIPOISE_REFERENCE, m = frame.EQUIPOISE_MOTORS;
  const c = frame.EQUIPOISE_COMMAND, h = frame.EQUIPOISE_HEALTH, f = frame.EQUIPOISE_FAULTS, w = frame.WHAT_IF_STATE;
  const state = (x, f) => (x ? f(x) : NaN);
  const speed = (x) => (x ? (speeds[robot] ?? speeds.mbbr)(x, radius) : [NaN, NaN]);
  return [s.utime * 1e-6, deg(s.theta_rad[0]), deg(s.theta_rad[1]), state(r, (x) => deg(x.theta_rad[0])),
    state(r, (x) => deg(x.theta_rad[1])), ...speed(s), ...speed(r),
    turns(s.omega_B_rad_s[2]), state(c, (x) => turns(x.yaw_rate_rad_s)),
    ...[0, 1, 2, 3].map((i) => (m && i < m.motors ? m.duty[i] : NaN)), h ? h.battery_V : NaN, s.normalized_innovation,
    ...(f ? [f.ratio, f.runner_up_ratio, f.bound] : [NaN, NaN, NaN]),
    state(w, (x) => deg(x.theta_rad[0])), state(w, (x) => deg(x.theta_rad[1])), state(w, (x) => x.normalized_innovation),
    frame.WHAT_IF_FAULTS ? frame.WHAT_IF_FAULTS.ratio : NaN];
}

const FAULTS = ["Fault hypotheses, log-likelihood ratio (nats)", ["ratio", "leading", "blue"], ["runnerUp", "runner-up", "green"], ["bound", "bound", "red", [4, 3]],
  ["thenRatio", "what if", "pink", [2, 2]]];
const PANELS = {
  mbbr: [
    ["Tilt (deg)", ["tiltX", "about x", "blue"], ["tiltY", "about y", "green"], ["refX", "target x", "red", [4, 3]], ["refY", "target y", "yellow", [4, 3]],
      ["thenX", "what if x", "pink", [2, 2]], ["thenY", "what if y", "black", [2, 2]]],
    ["Speed along the robot (cm/s)", ["speedX", "forward", "blue"], ["speedY", "left", "green"], ["refSpeedX", "target forward", "red", [4, 3]], ["refSpeedY", "target left", "yellow", [4, 3]]],
    ["Yaw rate (Hz)", ["yaw", "measured", "blue"], ["wantedYaw", "target", "red", [4, 3]]],
    ["Duty", ["duty0", "motor 1", "blue"], ["duty1", "motor 2", "green"], ["duty2", "motor 3", "pink"]],
    ["Battery (V) and NIS/dof", ["battery", "battery", "yellow"], ["nis", "NIS/dof", "black"], ["thenNis", "what if", "pink", [2, 2]]],
    FAULTS,
  ],
  mip: [
    ["Tilt (deg)", ["tiltX", "tilt", "blue"], ["refX", "target", "red", [4, 3]], ["thenX", "what if", "pink", [2, 2]]],
    ["Wheel speed (cm/s)", ["speedX", "measured", "blue"], ["refSpeedX", "target", "red", [4, 3]]],
    ["Yaw rate (Hz)", ["yaw", "measured", "blue"], ["wantedYaw", "target", "red", [4, 3]]],
    ["Duty", ["duty0", "motor 1", "blue"], ["duty1", "motor 2", "green"]],
    ["Battery (V) and NIS/dof", ["battery", "battery", "yellow"], ["nis", "NIS/dof", "black"], ["thenNis", "what if", "pink", [2, 2]]],
    FAULTS,
  ],
};

export class Plots {
  constructor(element) {
    this.element = element;
    this.history = new History(Object.keys(SIGNALS).length);
    this.paused = false;
    this.beside = false; // another tuning's curves are drawn
    this.onpause = () => {};
    this.plots = [];
    new ResizeObserver(() => this.plots.forEach((p) => p.plot.setSize(this.size()))).observe(element);
  }

  size() { return { width: Math.max(200, this.element.clientWidth), height: 116 }; }

  build(robot) {
    if (robot === this.robot) return;
    this.robot = robot;
    this.plots.forEach((p) => p.plot.destroy());
    this.history.clear();
    this.plots = (PANELS[robot] ?? PANELS.mbbr).map(([title, ...all]) => {
      // Beside another tuning the battery makes room for the NIS of both.
      const series = all.filter(([signal]) => (this.beside ? signal !== "battery" : !signal.startsWith("then")));
      const columns = [SIGNALS.t, ...series.map(([signal]) => SIGNALS[signal])];
      const style = getComputedStyle(document.body).color;
      const axis = { stroke: style, grid: { stroke: "#8883", width: 1 }, ticks: { stroke: "#8883" }, font: "11px system-ui" };
      const options = {
        ...this.size(),
        cursor: { sync: { key: "cockpit" }, drag: { x: true, y: false, setScale: true } },
        scales: { x: { time: false }, y: { range: (u, lo, hi) => (Number.isFinite(lo) && hi > lo ? [lo - .08 * (hi - lo), hi + .08 * (hi - lo)] : [(lo || 0) - 1, (hi || 0) + 1]) } },
        axes: [{ ...axis, size: 30 }, { ...axis, size: 54, space: 18 }],
        series: [{ label: "t (s)", value: (u, v) => (v == null ? "" : v.toFixed(2)) },
          ...series.map(([, label, colour, dash]) => ({ label, stroke: COLOURS[colour], width: 1.4, dash,
            value: (u, v) => (v == null || Number.isNaN(v) ? "" : v.toFixed(2)) }))],
        hooks: { setSelect: [() => this.pause(true)] },
      };
      const holder = document.createElement("div");
      const heading = document.createElement("div");
      heading.className = "fine";
      heading.textContent = title;
      holder.append(heading);
      this.element.append(holder);
      return { columns, plot: new uPlot(options, this.history.view(columns), holder), holder };
    });
    for (const p of this.plots) {
      const destroy = p.plot.destroy;
      p.plot.destroy = () => { destroy(); p.holder.remove(); };
    }
  }

  pause(on) { this.paused = on; this.onpause(on); if (!on) this.dirty = true; }

  add(frame, radius) {
    if (!frame.EQUIPOISE_STATE) return;
    const values = row(frame, this.robot, radius);
    if (values[0] < this.history.last()) this.history.clear(); // a new start, or a seek backwards
    this.history.push(values);
    this.dirty = true;
  }

  /** Redraws what has changed; one plot per call, so that no picture of the robot waits for all. */
  draw() {
    if (this.paused || !this.plots.length || !this.history.length) return;
    this.next = ((this.next ?? -1) + 1) % this.plots.length;
    if (this.next === 0) {
      this.drawing = this.dirty;
      this.dirty = false;
      this.until = this.history.last();
    }
    if (!this.drawing) return;
    const { plot, columns } = this.plots[this.next];
    plot.batch(() => {
      plot.setData(this.history.view(columns), false);
      plot.setScale("x", { min: this.until - WINDOW_S, max: this.until });
    });
  }
}
