// What a person does with mouse, finger, keys or gamepad -> a motion, 20 times a second while there is one.
const PERIOD_MS = 50, ENDS = 6; // zeros after the last motion
const DEAD = 0.12; // of a gamepad's axis
const KEYS = { KeyW: [1, 0, 0], ArrowUp: [1, 0, 0], KeyS: [-1, 0, 0], ArrowDown: [-1, 0, 0], KeyA: [0, 1, 0], ArrowLeft: [0, 1, 0],
  KeyD: [0, -1, 0], ArrowRight: [0, -1, 0], KeyQ: [0, 0, 1], KeyE: [0, 0, -1] };
const clamp = (x) => Math.max(-1, Math.min(1, x));
const element = (id) => document.getElementById(id);

export class Inputs {
  /** `send(forward, left, yaw)` in shares of full; `stop()` and `disarm()` at a key or button; `ready()`: may move. */
  constructor({ send, stop, disarm, ready }) {
    Object.assign(this, { send, stop, disarm, ready });
    this.pressed = new Set();
    this.stick = [0, 0];
    this.turn = 0;
    this.ends = 0;
    this.padButtons = [];
    this.dragging = null; // the pointer that holds the stick
    this.held = false; // after a stop, or pushed while nothing might move: until everything is let go
    this.listen();
    setInterval(() => this.tick(), PERIOD_MS);
  }

  listen() {
    const typing = (event) => event.target.closest("input:not([type=range]):not([type=checkbox]), select, textarea");
    addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.code === "Escape") this.disarm(); // wherever the focus is
      else if (typing(event)) return;
      else if (event.code === "Space") { event.preventDefault(); this.halt(); }
      else if (event.code in KEYS) {
        event.preventDefault();
        if (!event.repeat) this.pressed.add(event.code); // a stop is not undone by a key that is still down
      }
    });
    addEventListener("keyup", (event) => this.pressed.delete(event.code));
    addEventListener("blur", () => this.letGo());
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.letGo(); });
    const stick = element("stick");
    const move = (event) => {
      if (event.pointerId !== this.dragging) return;
      const box = stick.getBoundingClientRect(), r = box.width / 2 - 23;
      let x = (event.clientX - box.left - box.width / 2) / r, y = (event.clientY - box.top - box.height / 2) / r;
      const length = Math.max(1, Math.hypot(x, y));
      x /= length;
      y /= length;
      this.stick = [-y, -x];
      element("knob").style.transform = `translate(${x * r}px, ${y * r}px)`;
    };
    stick.addEventListener("pointerdown", (event) => { stick.setPointerCapture(event.pointerId); this.dragging = event.pointerId; move(event); });
    stick.addEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) stick.addEventListener(end, () => this.centre());
    for (const [id, sign] of [["left", 1], ["right", -1]]) {
      const button = element(id);
      button.addEventListener("pointerdown", (event) => { button.setPointerCapture(event.pointerId); this.turn = sign; });
      for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, () => { this.turn = 0; });
    }
  }

  centre() { this.dragging = null; this.stick = [0, 0]; element("knob").style.transform = ""; }
  letGo() { this.pressed.clear(); this.centre(); this.turn = 0; this.held = true; }
  halt() { this.letGo(); this.ends = ENDS; this.stop(); }

  /** The first gamepad that is there: left stick drives, right stick's x turns, A stops, B disarms. */
  gamepad() {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((p) => p?.connected);
    element("gamepad").textContent = pad ? pad.id.slice(0, 40) : "no gamepad";
    if (!pad) return [0, 0, 0];
    const axis = (i) => { const v = pad.axes[i] ?? 0; return Math.abs(v) < DEAD ? 0 : v; };
    const down = pad.buttons.map((b) => b.pressed);
    if (down[0] && !this.padButtons[0]) this.halt();
    if (down[1] && !this.padButtons[1]) this.disarm();
    this.padButtons = down;
    return [-axis(1), -axis(0), -axis(2)];
  }

  motion() {
    const sum = [this.stick[0], this.stick[1], this.turn];
    for (const key of this.pressed) KEYS[key].forEach((v, i) => { sum[i] += v; });
    this.gamepad().forEach((v, i) => { sum[i] += v; });
    return sum.map(clamp);
  }

  tick() {
    const motion = this.motion();
    const moves = motion.some((v) => v !== 0);
    if (!this.ready() || document.hidden || !document.hasFocus()) this.held = true;
    else if (!moves) this.held = false;
    if (moves && !this.held) {
      this.ends = ENDS;
      this.send(...motion);
    } else if (this.ends > 0) {
      this.ends--;
      this.send(0, 0, 0);
    }
  }
}
