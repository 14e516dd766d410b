// The robot in its world: z up, x forward. In: state, geometry -> out: a picture.
import * as THREE from "three";
import { OrbitControls } from "/OrbitControls.js";

const TRAIL = 600; // points
const BODY = 0x2b6ca3, WHEEL = 0x333333, BALL = 0xe8e2d0;

function stripes(a, b, n) {
  const canvas = document.createElement("canvas");
  canvas.width = 128;
  canvas.height = 64;
  const c = canvas.getContext("2d");
  c.fillStyle = a;
  c.fillRect(0, 0, 128, 64);
  c.fillStyle = b;
  for (let i = 0; i < n; i++) c.fillRect((i * 128) / n, 0, 64 / n, 64);
  return new THREE.CanvasTexture(canvas);
}
const solid = (colour) => new THREE.MeshLambertMaterial({ color: colour });

/** A cylinder along x. */
function wheel(radius, width, material) {
  const mesh = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, width, 24).rotateZ(Math.PI / 2), material);
  return mesh;
}

function mbbr(g) {
  const r = g.ball_radius_m ?? 0.032, rw = g.wheel_radius_m ?? 0.0125, l = g.com_height_m ?? 0.1;
  const body = new THREE.Group();
  const wheels = [];
  const latitude = ((g.wheel_latitude_deg ?? 60) * Math.PI) / 180; // from the north pole
  const azimuth = ((g.wheel_azimuth_deg ?? -140) * Math.PI) / 180;
  for (let i = 0; i < 3; i++) {
    const hub = new THREE.Group();
    const a = azimuth + (i * 2 * Math.PI) / 3, d = r + rw;
    hub.position.set(d * Math.sin(latitude) * Math.cos(a), d * Math.sin(latitude) * Math.sin(a), d * Math.cos(latitude));
    const w = wheel(rw, 0.012, solid(WHEEL));
    w.quaternion.setFromUnitVectors(new THREE.Vector3(1, 0, 0),
      new THREE.Vector3(Math.cos(latitude) * Math.cos(a), Math.cos(latitude) * Math.sin(a), -Math.sin(latitude)));
    hub.add(w);
    body.add(hub);
    wheels.push(w);
  }
  const hull = new THREE.Mesh(new THREE.CylinderGeometry(0.042, 0.05, 1.5 * l, 20).rotateX(Math.PI / 2), solid(BODY));
  hull.position.z = r + 2 * rw + 0.75 * l - 0.01;
  const top = new THREE.Mesh(new THREE.CylinderGeometry(0.046, 0.046, 0.008, 20).rotateX(Math.PI / 2), solid(0xf0f0f0));
  top.position.z = hull.position.z + 0.75 * l;
  const nose = new THREE.Mesh(new THREE.ConeGeometry(0.012, 0.03, 12).rotateZ(-Math.PI / 2), solid(0xd55e00));
  nose.position.set(0.05, 0, hull.position.z + 0.3 * l);
  body.add(hull, top, nose);
  const ball = new THREE.Mesh(new THREE.SphereGeometry(r, 28, 18), new THREE.MeshLambertMaterial({ map: stripes("#e8e2d0", "#b8763a", 6) }));
  return { body, ball, wheels, height: r, from: [-0.55, -0.25, 0.36] };
}

function mip(g) {
  const r = g.wheel_radius_m ?? 0.035, track = g.track_m ?? 0.07, l = g.com_height_m ?? 0.046;
  const body = new THREE.Group();
  const face = new THREE.MeshLambertMaterial({ map: stripes("#333", "#777", 5) });
  const wheels = [-1, 1].map((side) => {
    const w = wheel(r, 0.02, face);
    w.position.x = (side * track) / 2;
    return w;
  });
  const hull = new THREE.Mesh(new THREE.BoxGeometry(track - 0.028, 0.035, 2.2 * l), solid(BODY));
  hull.position.z = 0.9 * l;
  const eye = new THREE.Mesh(new THREE.ConeGeometry(0.008, 0.02, 12).rotateX(Math.PI), solid(0xd55e00));
  eye.position.set(0, -0.024, 1.5 * l); // it drives towards -y
  body.add(hull, eye);
  return { body, ball: null, wheels, height: r, from: [-0.25, 0.5, 0.3] };
}

/** Without a graphics card smooth edges cost four times the work. */
function drawnByTheProcessor() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const name = gl ? String(gl.getParameter(gl.RENDERER)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|subzero/i.test(name);
}

export class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !drawnByTheProcessor() });
    this.ratio = Math.min(devicePixelRatio, 1.5);
    this.renderer.setPixelRatio(this.ratio);
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0xdfe7ec);
    this.scene.fog = new THREE.Fog(0xdfe7ec, 1.5, 6);
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.01, 30);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(0, 0, 0.1);
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.minDistance = 0.2;
    this.controls.maxDistance = 5;
    this.follow = true;
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x998877, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(-1, 1, 3);
    this.scene.add(sun);
    const floor = new THREE.Mesh(new THREE.PlaneGeometry(60, 60), new THREE.MeshBasicMaterial({ color: 0xd5dbd7 }));
    floor.position.z = -0.001;
    this.grid = new THREE.GridHelper(8, 80, 0x8fa0a8, 0xa9b6b8).rotateX(Math.PI / 2);
    this.scene.add(floor, this.grid);
    this.wish = new THREE.ArrowHelper(new THREE.Vector3(1, 0, 0), new THREE.Vector3(), 0.1, 0xd55e00, 0.03, 0.02);
    this.wish.visible = false;
    const line = new THREE.BufferGeometry();
    line.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * TRAIL), 3));
    this.trail = new THREE.Line(line, new THREE.LineBasicMaterial({ color: 0x0072b2 }));
    this.trail.frustumCulled = false;
    this.shadow = new THREE.Mesh(new THREE.CircleGeometry(0.05, 24), new THREE.MeshBasicMaterial({ color: 0, transparent: true, opacity: 0.18 }));
    this.shadow.position.z = 0.0005;
    this.scene.add(this.wish, this.trail, this.shadow);
    this.points = 0;
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    this.resize();
  }

  /** Fewer pixels, when there are too few pictures a second. */
  coarser() {
    if (this.ratio <= 0.5) return;
    this.ratio = Math.max(0.5, 0.75 * this.ratio);
    this.renderer.setPixelRatio(this.ratio);
    this.resize();
  }

  resize() {
    const { clientWidth: w, clientHeight: h } = this.canvas.parentElement;
    if (!w || !h) return;
    this.renderer.setSize(w, h, false);
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
  }

  build(robot, geometry) {
    if (this.robot) this.scene.remove(this.robot.all);
    const parts = (robot === "mip" ? mip : mbbr)(geometry);
    parts.all = new THREE.Group();
    parts.all.add(parts.body);
    if (parts.ball) parts.all.add(parts.ball);
    else parts.all.add(...parts.wheels);
    this.kind = robot;
    this.robot = parts;
    this.scene.add(parts.all);
    this.camera.position.set(...parts.from);
    this.controls.target.set(0, 0, 0.1);
    this.forget();
  }

  forget() { this.points = 0; this.last = null; }

  /** state_t, and the command's velocity in world axes. */
  put(state, command) {
    if (!this.robot) return;
    const [x, y] = state.position_W_m;
    const [tx, ty, yaw] = state.theta_rad;
    if (![x, y, tx, ty, yaw].every(Number.isFinite)) return;
    const { all, body, ball, wheels, height } = this.robot;
    const dx = this.last ? x - this.last.x : 0, dy = this.last ? y - this.last.y : 0;
    if (Math.hypot(dx, dy) > 0.5) this.forget(); // a new start, or a seek
    all.position.set(x, y, height);
    this.shadow.position.x = x;
    this.shadow.position.y = y;
    if (this.kind === "mip") {
      all.rotation.set(0, 0, yaw);
      body.rotation.set(tx, 0, 0);
      for (const w of wheels) w.rotation.x = state.phi_rad[0] + tx;
    } else {
      body.rotation.set(tx, ty, yaw, "ZYX");
      const way = Math.hypot(dx, dy);
      if (way > 0 && this.last) // rolls without slipping
        ball.rotateOnWorldAxis(new THREE.Vector3(-dy / way, dx / way, 0), way / height);
    }
    if (this.follow && this.last) {
      this.camera.position.x += dx;
      this.camera.position.y += dy;
    }
    if (this.follow) {
      if (!this.last) {
        this.camera.position.x += x - this.controls.target.x;
        this.camera.position.y += y - this.controls.target.y;
      }
      this.controls.target.set(x, y, 0.1);
    }
    if (!this.last || Math.hypot(x - this.marked.x, y - this.marked.y) > 0.004) this.mark(x, y);
    this.last = { x, y };
    this.grid.position.x = Math.round(x / 0.1) * 0.1;
    this.grid.position.y = Math.round(y / 0.1) * 0.1;
    const speed = command ? Math.hypot(...command.velocity_W_m_s) : 0;
    this.wish.visible = speed > 1e-3;
    if (this.wish.visible) {
      // A robot on two wheels goes where its nose, -y, points.
      const [vx, vy] = this.kind === "mip"
        ? [Math.sin(yaw) * command.velocity_W_m_s[0], -Math.cos(yaw) * command.velocity_W_m_s[0]] : command.velocity_W_m_s;
      this.wish.position.set(x, y, 0.01);
      this.wish.setDirection(new THREE.Vector3(vx, vy, 0).normalize());
      this.wish.setLength(0.06 + speed, 0.03, 0.02);
    }
  }

  mark(x, y) {
    const position = this.trail.geometry.attributes.position;
    if (this.points === TRAIL) {
      position.array.copyWithin(0, 3);
      this.points--;
    }
    position.array.set([x, y, 0.002], 3 * this.points++);
    position.needsUpdate = true;
    this.trail.geometry.setDrawRange(0, this.points);
    this.marked = { x, y };
  }

  draw() {
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }
}
