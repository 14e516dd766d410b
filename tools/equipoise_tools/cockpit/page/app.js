// The page: one WebSocket, what it says shown, what a person does said to it.
import { Decoder, LIVE, PLAYED } from "/decode.js";
import { Inputs } from "/inputs.js";
import { Plots } from "/plots.js";
import { Scene } from "/scene.js";

const EVENTS = 200, RETRY_MS = 1000;
const $ = (id) => document.getElementById(id);
/** Only what changes makes the browser lay out anew. */
const show = (id, text) => { if ($(id).textContent !== text) $(id).textContent = text; };
const bits = (value, words) => words.filter((_, i) => (value >>> i) & 1);

// The token is in the link's fragment: never sent to a server, kept for this tab and this port alone.
if (location.hash.length > 1) {
  sessionStorage.setItem("token", location.hash.slice(1));
  history.replaceState(null, "", location.pathname);
}

const scene = new Scene($("scene"));
const plots = new Plots($("plots"));
let socket = null, decoder = null, words = null, status = {}, parameters = [], geometry = {}, playback = null, play = null;
let newest = null, robot = null, radius = 1, shownEvent = "", unauthorised = false;
const changes = new Map();
/** Counted here, read by tests and by whoever opens the console. */
const stats = { frames: 0, drawn: 0, pictures: 0, fps: 0, latency_ms: [], socketOpens: 0, get history() { return plots.history.length; },
  get newest() { return newest; }, get status() { return status; } };
window.cockpit = stats;

// With what a person does goes the newest time of the cockpit's that has come: what was held up on its way is void.
let seen = null;
const say = (request) => { if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ ...request, seen })); };
let messageTimer = 0;
function message(text) {
  $("message").textContent = text;
  $("message").hidden = !text;
  clearTimeout(messageTimer);
  if (text && !unauthorised) messageTimer = setTimeout(() => message(""), 6000);
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { stats.socketOpens++; socket.send(JSON.stringify({ do: "hello", token: sessionStorage.getItem("token") ?? "" })); };
  socket.onmessage = ({ data }) => (typeof data === "string" ? heard(JSON.parse(data)) : decoder.frames(data).forEach(take));
  socket.onclose = ({ code }) => {
    status = {};
    if (code === 4401) {
      unauthorised = true;
      message("This page may not talk to the cockpit: open the link that tools/cockpit has printed in its terminal.");
    } else setTimeout(connect, RETRY_MS);
    showStatus();
  };
}

function heard(event) {
  if (event.beat !== undefined) { seen = event.beat; return; }
  if (event.hello) {
    decoder = new Decoder(event.hello.channels);
    words = event.hello.words;
    stats.hello = event.hello;
    $("title").textContent = event.hello.title;
    $("restart").hidden = !event.hello.can_restart;
    message("");
    say({ do: "logs" });
  }
  if (event.parameters) showParameters(event.parameters);
  if (event.status) { status = event.status; showStatus(); }
  if (event.error) message(event.error);
  if (event.error) $("filter-again").disabled = false;
  if ("what_if" in event) showWhatIf(event.what_if);
  if (event.logs) showLogs(event.logs);
  if ("playback" in event) showPlayback(event.playback);
  if (event.play) showPlay(event.play);
}

function take(frame) {
  stats.frames++;
  const wanted = playback ? frame.kind !== LIVE : frame.kind === LIVE;
  if (!wanted || !frame.EQUIPOISE_STATE) return;
  if (frame.kind === LIVE || frame.kind === PLAYED) newest = frame;
  plots.add(frame, radius);
  if (frame.EQUIPOISE_TIMING_HISTOGRAM) stats.loop = frame.EQUIPOISE_TIMING_HISTOGRAM;
  note(frame);
}

// State of the robot.

function note(frame) {
  const health = frame.EQUIPOISE_HEALTH;
  if (!health || !words) return;
  const said = [words.arm_states[health.arm_state] ?? `state ${health.arm_state}`,
    ...bits(health.reasons, words.reasons).map(([word]) => word), ...bits(health.sensor_health, words.sensor_health).map(([word]) => word),
    ...bits(health.degraded, words.degraded).map(([word]) => word),
    ...bits(frame.EQUIPOISE_FAULTS?.verdicts, words.faults).map((word) => `verdict: ${word}`)].join(", ");
  if (said === shownEvent) return;
  shownEvent = said;
  const item = document.createElement("li");
  item.textContent = `${(health.utime * 1e-6).toFixed(2)} s  ${said}`;
  $("events").prepend(item);
  while ($("events").childElementCount > EVENTS) $("events").lastChild.remove();
}

function showHealth() {
  const live = playback || status.heard;
  const health = live && newest?.EQUIPOISE_HEALTH;
  const state = health ? (words.arm_states[health.arm_state] ?? `state ${health.arm_state}`) : "unknown";
  $("state").dataset.state = state;
  show("arm-state", health ? state : socket?.readyState === WebSocket.OPEN ? "no telemetry" : "no connection");
  const why = health ? [...bits(health.reasons, words.reasons), ...bits(health.sensor_health, words.sensor_health)] : [];
  show("reasons", why.map(([, sentence]) => sentence).join("; "));
  const without = health ? bits(health.degraded, words.degraded) : [];
  $("degraded").hidden = !without.length;
  show("degraded", without.map(([, sentence]) => sentence).join("; "));
  show("battery", health ? `${health.battery_V.toFixed(2)} V` : "- V");
}

function showStatus() {
  const { simulated, remote, run } = status;
  const kind = status.robot ?? "mbbr";
  if (kind !== robot) { robot = kind; rebuild(); }
  const open = socket?.readyState === WebSocket.OPEN;
  show("link", !open ? "no connection" : run ? `${run.robot} · ${run.estimator} · ${run.controller}` : status.heard ? kind : "silent");
  const robotStatus = remote?.status, mine = Boolean(status.mine), over = mine && robotStatus && !robotStatus.mine;
  $("take").hidden = stats.hello && !stats.hello.can_command;
  show("take", over ? `${robotStatus.holder || "another sender"} has taken over: resume control` : mine ? "In control: release" : "Take control");
  $("take").classList.toggle("on", mine && !over);
  $("take").dataset.next = mine && !over ? "release" : "take";
  const may = mine && robotStatus && !playback;
  $("arm").disabled = !may || robotStatus.state === "armed";
  $("stop").disabled = !may;
  $("disarm").disabled = !robotStatus;
  $("heading").disabled = !may;
  show("firmware", simulated ? (simulated.running ? (remote?.error ?? "") : `ended: ${simulated.last_words}`) : (remote?.error ?? ""));
  $("restart").classList.toggle("on", Boolean(simulated && !simulated.running));
  show("record", status.recording ? "Stop recording" : "Record");
  show("recording", status.recording ? status.recording.name : "");
  if (status.parameter_error || status.recording_error) message(status.parameter_error || status.recording_error);
  showParameterNote();
}

function rebuild() {
  plots.build(robot);
  scene.build(robot, geometry);
  radius = (robot === "mip" ? geometry.wheel_radius_m : geometry.ball_radius_m) ?? 1;
}

// Parameters.

function showParameters(list) {
  parameters = list;
  changes.clear();
  geometry = Object.fromEntries(list.filter((p) => p.key.startsWith("robot.")).map((p) => [p.key.slice(6), p.value]));
  if (robot) { plots.robot = null; rebuild(); }
  const body = $("parameters").tBodies[0];
  body.replaceChildren(...list.map((p) => {
    const tr = document.createElement("tr");
    tr.dataset.key = p.key;
    const cell = (text, title) => { const td = document.createElement("td"); td.textContent = text ?? ""; if (title) td.title = title; return td; };
    const value = document.createElement("td"), input = document.createElement("input");
    input.value = typeof p.value === "string" ? p.value : JSON.stringify(p.value);
    input.dataset.was = input.value;
    input.setAttribute("aria-label", p.key);
    input.addEventListener("input", () => {
      if (input.value === input.dataset.was) changes.delete(p.key);
      else changes.set(p.key, input.value);
      tr.classList.toggle("changed", changes.has(p.key));
      showParameterNote();
    });
    value.append(input);
    tr.append(cell(p.key, p.source), value, cell(p.unit), cell(p.allowed), cell(p.where, p.source));
    return tr;
  }));
  filterParameters();
  showParameterNote();
}

function filterParameters() {
  const wanted = $("filter").value.toLowerCase();
  for (const tr of $("parameters").tBodies[0].rows) tr.hidden = Boolean(wanted) && !tr.dataset.key.toLowerCase().includes(wanted);
}

function showParameterNote() {
  const may = Boolean(status.simulated && status.mine);
  $("apply").hidden = !may || !changes.size;
  for (const input of $("parameters").querySelectorAll("input")) input.readOnly = !may;
  $("parameter-note").textContent = !parameters.length ? "unknown: give --config FILE or --robot"
    : status.simulated ? (may ? "a change starts the simulated robot anew" : "take control to change them")
      : "as in the configuration file; read-only for a robot: its firmware takes none while it runs";
}

// Playback.

function showLogs(logs) {
  $("logs").replaceChildren(new Option("replay a log…", ""), ...logs.map((l) => new Option(`${l.name}  (${(l.bytes / 1e6).toFixed(1)} MB)`, l.name)));
}

function showPlayback(described) {
  playback = described;
  $("player").hidden = !described;
  showWhatIf(null);
  plots.history.clear();
  scene.forget();
  shownEvent = "";
  newest = null;
  if (described) {
    Object.assign($("slider"), { min: described.first_s, max: described.last_s, value: described.first_s });
    message(`${described.name}: ${described.outcome}`);
    if (described.robot !== robot) { robot = described.robot; rebuild(); }
  } else {
    $("logs").value = "";
    if (status.robot) { robot = null; }
  }
  plots.pause(false);
  showStatus();
}

/** Numbers of the run and of another tuning; the plots get a curve of it. */
function showWhatIf(told) {
  $("filter-again").disabled = false;
  $("what-if").hidden = !told;
  $("what-if").querySelector("p").textContent = told ? `${told.set.join("; ")}. ${told.note}` : "";
  $("what-if").querySelector("tbody").replaceChildren(...(told?.rows ?? []).map((row) => {
    const tr = document.createElement("tr");
    tr.append(...row.map((text) => { const td = document.createElement("td"); td.textContent = text; return td; }));
    tr.classList.toggle("changed", row[1] !== row[2]);
    return tr;
  }));
  if (plots.beside === Boolean(told)) return;
  plots.beside = Boolean(told);
  plots.robot = null;
  plots.build(robot);
}

function showPlay(state) {
  play = state;
  if (document.activeElement !== $("slider") || state.playing) $("slider").value = state.t_s;
  $("slider-time").textContent = `${state.t_s.toFixed(2)} s`;
  $("play").textContent = state.playing ? "Pause" : "Play";
}

// Timing: the robot's own histogram, or how old a tick is when this page has drawn it.

function showTiming() {
  const canvas = $("histogram"), c = canvas.getContext("2d"), latency = stats.latency_ms;
  c.clearRect(0, 0, canvas.width, canvas.height);
  const sorted = [...latency].sort((a, b) => a - b), at = (q) => sorted[Math.floor(q * (sorted.length - 1))] ?? NaN;
  const timing = newest?.EQUIPOISE_TIMING, loop = stats.loop;
  let text = latency.length ? `Tick to screen: median ${at(0.5).toFixed(0)} ms, 99 % ${at(0.99).toFixed(0)} ms; ${stats.fps} pictures a second. ` : "";
  let counts = [], labels = [];
  if (loop) {
    text += `Loop: ${timing.overruns} overruns, ${timing.dropped_records} records lost. Since the start: blue: a tick's computing; red: how late it woke.`;
    const used = loop.upper_ns.map((_, i) => i).filter((i) => loop.compute[i] || loop.wake_late[i]);
    const first = Math.min(...used), last = Math.max(...used);
    for (let i = first; i <= last; i++) { counts.push([loop.compute[i], loop.wake_late[i]]); labels.push(`${(loop.upper_ns[i] / 1000).toPrecision(2)}`); }
    labels.unit = "µs";
  } else {
    text += "A simulated tick takes no time of its own; below: tick to screen.";
    const bins = 20, width = 5;
    counts = Array.from({ length: bins }, () => [0]);
    for (const ms of latency) counts[Math.max(0, Math.min(bins - 1, Math.floor(ms / width)))][0]++;
    labels = counts.map((_, i) => `${(i + 1) * width}`);
    labels.unit = "ms";
  }
  show("timing", text);
  const highest = Math.log1p(Math.max(1, ...counts.flat())), w = canvas.width / Math.max(1, counts.length);
  c.font = "10px system-ui";
  counts.forEach((group, i) => {
    group.forEach((n, k) => {
      const h = (Math.log1p(n) / highest) * (canvas.height - 16);
      c.fillStyle = k ? "#d55e00aa" : "#0072b2aa";
      c.fillRect(i * w + (k * w) / group.length, canvas.height - 14 - h, w / group.length - 1, h);
    });
    c.fillStyle = "#888";
    if (i % Math.ceil(counts.length / 12) === 0) c.fillText(labels[i] + (i ? "" : ` ${labels.unit}`), i * w, canvas.height - 2);
  });
}

// Drawing.

const ENOUGH_FPS = 30;
let drawnFrame = null, second = performance.now(), passes = 0;
function draw(now) {
  requestAnimationFrame(draw);
  if (newest && newest !== drawnFrame) {
    scene.put(newest.EQUIPOISE_STATE, newest.EQUIPOISE_COMMAND);
    if (newest.kind === LIVE) {
      stats.latency_ms.push(performance.timeOrigin + performance.now() - 1000 * newest.stamp_s);
      if (stats.latency_ms.length > 1000) stats.latency_ms.shift();
    }
    drawnFrame = newest;
    stats.drawn++;
  }
  scene.draw();
  plots.draw();
  passes++;
  stats.pictures++;
  if (now - second < 1000) return;
  stats.fps = Math.round((1000 * passes) / (now - second));
  if (stats.fps < ENOUGH_FPS && now - second < 2000 && !document.hidden) scene.coarser();
  second = now;
  passes = 0;
  showTiming();
  say({ do: "seen", page: { drawn: stats.drawn, fps: stats.fps } });
}

function readout() {
  if (!words) return;
  showHealth();
  const s = newest?.EQUIPOISE_STATE;
  show("readout", s ? [`t ${(s.utime * 1e-6).toFixed(1)} s`, `x ${(100 * s.position_W_m[0]).toFixed(1)} cm  y ${(100 * s.position_W_m[1]).toFixed(1)} cm`,
    `yaw ${(s.omega_B_rad_s[2] / 2 / Math.PI).toFixed(2)} Hz`].join("\n") : "");
}

// What a person does.

const inputs = new Inputs({
  send: (forward, left, yaw) => {
    if (!status.mine || playback) return;
    const speed = Number($("max-speed").value);
    say({ do: "drive", velocity_m_s: [forward * speed, robot === "mip" ? 0 : left * speed],
      yaw_hz: Math.max(-1, Math.min(1, yaw + (robot === "mip" ? left : 0))) * Number($("max-yaw").value) });
  },
  stop: () => { if (status.mine) say({ do: "drive", velocity_m_s: [0, 0], yaw_hz: 0 }); },
  disarm: () => say({ do: "disarm" }),
  ready: () => Boolean(status.mine && !playback && status.remote?.status?.state === "armed"),
});
$("take").onclick = () => say({ do: $("take").dataset.next });
$("arm").onclick = () => say({ do: "arm" });
$("disarm").onclick = () => say({ do: "disarm" });
$("stop").onclick = () => inputs.halt();
$("heading").onclick = () => say({ do: "heading-reset" });
$("restart").onclick = () => say({ do: "restart" });
$("record").onclick = () => say({ do: "record", on: !status.recording });
$("pause").onclick = () => plots.pause(!plots.paused);
plots.onpause = (on) => { $("pause").textContent = on ? "Resume plots" : "Pause plots"; };
$("follow-camera").onchange = (event) => { scene.follow = event.target.checked; };
$("filter").oninput = filterParameters;
$("apply").onclick = () => say({ do: "set", changes: Object.fromEntries(changes) });
$("logs").onfocus = () => say({ do: "logs" });
$("logs").onchange = (event) => { if (event.target.value) say({ do: "open", log: event.target.value }); };
$("play").onclick = () => say({ do: play?.playing ? "pause" : "play", rate: Number($("rate").value) });
$("rate").onchange = () => { if (play?.playing) say({ do: "play", rate: Number($("rate").value) }); };
$("slider").oninput = (event) => { plots.history.clear(); scene.forget(); say({ do: "seek", t_s: Number(event.target.value) }); };
$("filter-again").onclick = () => { $("filter-again").disabled = true; say({ do: "what-if", changes: $("changes").value }); };
$("close-log").onclick = () => say({ do: "close" });
for (const [id, unit] of [["max-speed", "m/s"], ["max-yaw", "turns/s"]]) {
  const show = () => { $(id).nextElementSibling.textContent = `${$(id).value} ${unit}`; };
  $(id).oninput = show;
  show();
}

connect();
requestAnimationFrame(draw);
setInterval(readout, 100);
