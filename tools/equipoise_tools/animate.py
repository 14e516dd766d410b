"""python -m equipoise_tools.animate LOG --out FILE.gif [--from-s A] [--duration-s D] [--fps F] [--title TEXT]

A moving picture of an MBBR's log, drawn from what the robot itself recorded: its estimate of tilt, heading
and position, and the sensors that it excludes. The picture of the README:

  equipoise run --backend sim --config config/mbbr.toml --fault encoder_dead@7 --yaw-hz 1 --drive-mps 0.1
      --duration-s 14 --speed 50 --telemetry off --log build/readme.lcm
  python -m equipoise_tools.animate build/readme.lcm --out docs/images/spin-and-drive.gif --from-s 2
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

import numpy as np
from equipoise_robot.log import Log, read_log
from PIL import Image

from . import names, style
from .entry import leave
from .paths import UserError
from .style import plt

BALL_M, BODY_R_M, BODY_Z_M = 0.032, 0.038, (0.030, 0.165)  # drawn size, about [T] Fig. 2.11
CAMERA_AZIMUTH, CAMERA_ELEVATION = np.radians(-60.0), np.radians(18.0)
SIDES = 8
COLOURS = 16  # of the palette


def rotation(theta: np.ndarray) -> np.ndarray:
    """R_WB = Rz Ry Rx."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(theta), np.sin(theta)
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ y @ x


def seen(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(picture's x and y, depth towards the camera), orthographic."""
    ca, sa = np.cos(CAMERA_AZIMUTH), np.sin(CAMERA_AZIMUTH)
    ce, se = np.cos(CAMERA_ELEVATION), np.sin(CAMERA_ELEVATION)
    right = np.array([-sa, ca, 0.0])
    forward = np.array([-ca * ce, -sa * ce, -se])
    up = np.cross(right, forward)
    return np.stack([points @ right, points @ up], axis=-1), -(points @ forward)


def draw_floor(axes: plt.Axes, at: np.ndarray) -> None:
    step, reach = 0.1, 0.35
    for axis in (0, 1):
        for line in (
            np.arange(np.floor((at[axis] - reach) / step), np.ceil((at[axis] + reach) / step) + 1) * step
        ):
            ends = np.zeros((2, 3))
            ends[:, axis] = line - at[axis]
            ends[:, 1 - axis] = -reach, reach
            xy, _ = seen(ends)
            axes.plot(xy[:, 0], xy[:, 1], color="#D5D5D5", lw=0.8, zorder=0)


def draw_ball(axes: plt.Axes, turned: np.ndarray) -> None:
    centre = np.array([0.0, 0.0, BALL_M])
    (x, y), _ = seen(centre)
    axes.add_patch(plt.Circle((x, y), BALL_M, fc="#F2E6C9", ec="#555555", lw=1.0, zorder=2))
    a = np.linspace(0, 2 * np.pi, 60)
    for circle in (
        np.stack([np.cos(a), np.sin(a), 0 * a], 1),
        np.stack([0 * a, np.cos(a), np.sin(a)], 1),
        np.stack([np.cos(a), 0 * a, np.sin(a)], 1),
    ):
        points = circle @ turned.T * BALL_M
        xy, depth = seen(points + centre)
        xy[depth < seen(centre)[1]] = np.nan
        axes.plot(xy[:, 0], xy[:, 1], color="#B08D3C", lw=1.0, zorder=3)


def draw_body(axes: plt.Axes, R: np.ndarray) -> None:
    a = 2 * np.pi * (np.arange(SIDES) + 0.5) / SIDES
    ring = BODY_R_M * np.stack([np.cos(a), np.sin(a), 0 * a], 1)
    lower, upper = (ring + np.array([0, 0, z]) for z in BODY_Z_M)
    faces = [np.array([lower[i - 1], lower[i], upper[i], upper[i - 1]]) for i in range(SIDES)] + [upper]
    centre = np.array([0.0, 0.0, BALL_M])
    shown = []
    for i, face in enumerate(faces):
        xy, depth = seen(face @ R.T + centre)
        nose = i == 0  # towards body x
        shown.append((depth.mean(), xy, style.REFERENCE if nose else "#4C7CA8" if i % 2 else "#6E9AC2"))
    for order, (_, xy, colour) in enumerate(sorted(shown, key=lambda face: face[0])):
        axes.add_patch(plt.Polygon(xy, fc=colour, ec="white", lw=0.6, zorder=4 + 0.01 * order))


class Scene:
    def __init__(self, log: Log, first_s: float, duration_s: float, fps: float):
        if names.STATE not in log:
            raise UserError("the log has no estimate to draw")
        state, health = log[names.STATE], log[names.HEALTH]
        t_s = log.seconds(names.STATE)
        self.times = np.arange(first_s, min(first_s + duration_s, float(t_s[-1])), 1 / fps)
        if not self.times.size:
            raise UserError(f"the log ends at {t_s[-1]:.1f} s, before --from-s {first_s:g}")
        at = np.searchsorted(t_s, self.times)
        self.theta = state["theta_rad"][at]
        self.position = state["position_W_m"][at]
        self.path = state["position_W_m"][(t_s >= first_s)]
        self.degraded = health["degraded"][np.searchsorted(log.seconds(names.HEALTH), self.times)]
        self.armed = health["arm_state"][np.searchsorted(log.seconds(names.HEALTH), self.times)]
        self.first_s, self.turned = first_s, self.ball()

    def ball(self) -> list[np.ndarray]:
        """The ball's attitude: it rolls without slip along the path."""
        turned, found = np.eye(3), []
        moves = np.diff(self.position, axis=0, prepend=self.position[:1])
        for dx, dy in moves:
            angle = np.hypot(dx, dy) / BALL_M
            if angle > 0:
                k = np.array([-dy, dx, 0.0]) / np.hypot(dx, dy)
                K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
                turned = (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K) @ turned
            found.append(turned)
        return found

    def said(self, i: int) -> str:
        excluded = names.bits(int(self.degraded[i]), names.DEGRADED)
        words = ", ".join(word.removeprefix("without ") for word in excluded)
        return f"excluded: {words}" if excluded else "all sensors in use"

    def frame(self, i: int, title: str) -> Image.Image:
        with plt.rc_context(style.RC):
            figure = plt.figure(figsize=(6.0, 3.4), dpi=75)
            left = figure.add_axes((0.0, 0.12, 0.6, 0.78))
            left.set(aspect="equal", xlim=(-0.17, 0.17), ylim=(-0.06, 0.2))
            left.axis("off")
            at = self.position[i]
            draw_floor(left, at)
            draw_ball(left, self.turned[i])
            draw_body(left, rotation(self.theta[i]))
            right = figure.add_axes((0.66, 0.24, 0.3, 0.56))
            right.plot(*self.path.T, color="#DDDDDD", lw=1.0)
            right.plot(*self.position[: i + 1].T, color=style.ESTIMATE, lw=1.4)
            heading = self.theta[i, 2]
            right.plot(
                at[0] + np.array([0, 0.08 * np.cos(heading)]), at[1] + np.array([0, 0.08 * np.sin(heading)]),
                color=style.REFERENCE, lw=2.0,
            )  # fmt: skip
            low, high = self.path.min(0), self.path.max(0)
            middle, half = (low + high) / 2, max(float((high - low).max()) / 2, 0.2) + 0.1
            right.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
            right.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="path")
            figure.text(0.02, 0.94, title, weight="bold", size=9)
            said = self.said(i)
            colour = "#333333" if said.startswith("all") else style.REFERENCE
            figure.text(0.02, 0.04, f"{self.times[i]:5.1f} s", size=9, family="DejaVu Sans Mono")
            figure.text(0.14, 0.04, said, size=9, color=colour)
            data = io.BytesIO()
            figure.savefig(data, format="png", dpi=75)
            plt.close(figure)
        return Image.open(data).convert("RGB")


def write(frames: list[Image.Image], path: Path, fps: float) -> None:
    palette = frames[len(frames) // 2].quantize(COLOURS)
    flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    flat[0].save(
        path, save_all=True, append_images=flat[1:], duration=round(1000 / fps), loop=0, optimize=True
    )


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m equipoise_tools.animate", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("log", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="the picture, .gif")
    parser.add_argument("--from-s", type=float, default=0.0)
    parser.add_argument("--duration-s", type=float, default=8.0)
    parser.add_argument("--fps", type=float, default=5.0)
    parser.add_argument("--title", default="MBBR, simulated: 1 turn per second, 0.1 m/s")
    given = parser.parse_args(arguments)
    if given.fps <= 0 or given.duration_s <= 0:
        parser.error("--fps and --duration-s: above 0")
    scene = Scene(read_log(given.log), given.from_s, given.duration_s, given.fps)
    write([scene.frame(i, given.title) for i in range(scene.times.size)], given.out, given.fps)
    print(f"{given.out}: {scene.times.size} frames, {given.out.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    leave(main)
