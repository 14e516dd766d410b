"""Motion capture beside a log: align time and axes, find the ball, differentiate, smooth, compare. [T] 6.4.1.

Quaternions are w, x, y, z, rows over time. Mocap CSV: a header t_s,qw,qx,qy,qz,x_m,y_m,z_m (a rigid body's
orientation and centroid in a z-up frame).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from scipy.spatial.transform import Rotation

from .paths import UserError

COLUMNS = ("t_s", "qw", "qx", "qy", "qz", "x_m", "y_m", "z_m")


@dataclass
class Mocap:
    t_s: np.ndarray
    quaternion: np.ndarray
    position_m: np.ndarray


def read_csv(path: str | Path) -> Mocap:
    """Raises UserError naming the file and what is missing."""
    try:
        data = np.genfromtxt(path, delimiter=",", names=True)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:
        raise UserError(f"{path}: not a table of numbers: {error}") from None
    missing = [name for name in COLUMNS if name not in (data.dtype.names or ())]
    if missing:
        raise UserError(f"{path}: no column {', '.join(missing)}; expected {','.join(COLUMNS)}")
    rows = data[~np.any(np.isnan(np.stack([data[name] for name in COLUMNS])), axis=0)]
    if rows.size < 10:
        raise UserError(f"{path}: fewer than ten whole rows")
    stack = np.stack([rows[name] for name in COLUMNS], axis=1)
    return Mocap(stack[:, 0], stack[:, 1:5], stack[:, 5:8])


def rotation(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


def euler(quaternion: np.ndarray) -> np.ndarray:
    """Roll, pitch, continuous yaw of R = Rz Ry Rx."""
    angles = rotation(quaternion).as_euler("ZYX")[:, ::-1]
    return np.column_stack([angles[:, :2], np.unwrap(angles[:, 2])])


def turned(quaternion: np.ndarray) -> np.ndarray:
    """Angle turned since the start: the same whatever axes the markers and the room have."""
    r = rotation(quaternion)
    return (r[0].inv() * r).magnitude()


def spike(t_s: np.ndarray, tilt_rad: np.ndarray) -> float:
    """When the robot was put upright: the largest tilt rate, between samples by a parabola."""
    rate = np.abs(np.diff(tilt_rad) / np.diff(t_s))
    at = int(np.argmax(rate))
    middle = 0.5 * (t_s[:-1] + t_s[1:])
    if not 0 < at < rate.size - 1:
        return float(middle[at])
    left, centre, right = rate[at - 1 : at + 2]
    bend = left - 2 * centre + right
    shift = 0.5 * (left - right) / bend if bend else 0.0
    return float(middle[at] + shift * (middle[at + 1] - middle[at]))


def time_offset(
    t_a: np.ndarray,
    a: np.ndarray,
    t_b: np.ndarray,
    b: np.ndarray,
    guess_s: float = 0.0,
    window_s: float = 0.5,
) -> float:
    """Seconds to add to t_b so that b lies on a: best correlation near the guess, to a fraction of a "
    "sample."""

    def mismatch(offset: float) -> float:
        low, high = max(t_a[0], t_b[0] + offset), min(t_a[-1], t_b[-1] + offset)
        inside = (t_a >= low) & (t_a <= high)
        if np.count_nonzero(inside) < 10:
            return 1.0
        x = a[inside]
        y = np.interp(t_a[inside], t_b + offset, b)
        x, y = x - x.mean(), y - y.mean()
        length = np.linalg.norm(x) * np.linalg.norm(y)
        return -float(x @ y / length) if length else 1.0

    step = 0.5 * float(np.median(np.diff(t_b)))
    coarse = guess_s + np.arange(-window_s, window_s + step, step)
    best = coarse[int(np.argmin([mismatch(offset) for offset in coarse]))]
    fine = minimize_scalar(
        mismatch, bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-6}
    )
    return float(fine.x)


def align(t_log: np.ndarray, tilt_log: np.ndarray, t_mocap: np.ndarray, tilt_mocap: np.ndarray) -> float:
    """Start spike first, cross-correlation after it."""
    guess = spike(t_log, tilt_log) - spike(t_mocap, tilt_mocap)
    return time_offset(t_log, tilt_log, t_mocap, tilt_mocap, guess)


def mount(reference: np.ndarray, measured: np.ndarray) -> tuple[Rotation, Rotation]:
    """(left, right) with reference ~ left * measured * right: the rooms' axes and the markers' on the body.

    Relative motions do not know `left`: q_i^-1 q_j of both sides are conjugates by `right`.
    """
    r, m = rotation(reference), rotation(measured)
    step = max(1, len(r) // 400)
    lag = max(1, len(r) // 7)
    first = np.arange(0, len(r) - lag, step)
    moved_r = (r[first].inv() * r[first + lag]).as_rotvec()
    moved_m = (m[first].inv() * m[first + lag]).as_rotvec()
    right = Rotation.align_vectors(moved_m, moved_r)[0]
    left = (r * (m * right).inv()).mean()
    # A robot that stays upright hardly tells a turn of the room from one of the markers: fit both together.

    def mismatch(small: np.ndarray) -> np.ndarray:
        turned_left = left * Rotation.from_rotvec(small[:3])
        turned_right = right * Rotation.from_rotvec(small[3:])
        return (r.inv() * turned_left * m * turned_right).as_rotvec().ravel()

    best = least_squares(mismatch, np.zeros(6)).x
    left, right = left * Rotation.from_rotvec(best[:3]), right * Rotation.from_rotvec(best[3:])
    return left, right


def ball_position(position_m: np.ndarray, attitude: Rotation, lever_m: np.ndarray) -> np.ndarray:
    """Centre of the ball from that of the markers. (6.24)"""
    return position_m - attitude.apply(lever_m)


def central_difference(t_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Over two steps, divided by two steps: (6.25) as printed divides by one and doubles the speed."""
    inner = (values[2:] - values[:-2]) / (t_s[2:] - t_s[:-2]).reshape(-1, *[1] * (values.ndim - 1))
    return np.concatenate([inner[:1], inner, inner[-1:]])


def smooth(t_s: np.ndarray, values: np.ndarray, cutoff_rad_s: float = 10.0) -> np.ndarray:
    """First-order low-pass forwards and backwards, averaged: no phase. [T] 6.4.5"""
    keep = np.exp(-cutoff_rad_s * float(np.median(np.diff(t_s))))

    def forward(x: np.ndarray) -> np.ndarray:
        y = np.empty_like(x, dtype=float)
        y[0] = x[0]
        for i in range(1, len(x)):
            y[i] = keep * y[i - 1] + (1.0 - keep) * x[i]
        return y

    return 0.5 * (forward(values) + forward(values[::-1])[::-1])


def spectrum(t_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rad/s, amplitude) of one signal, mean removed, Hann window; a sine of amplitude one peaks at one."""
    window = np.hanning(values.size)
    amplitude = 2.0 * np.abs(np.fft.rfft((values - values.mean()) * window)) / window.sum()
    return 2.0 * np.pi * np.fft.rfftfreq(values.size, float(np.median(np.diff(t_s)))), amplitude


def rmse(estimate: np.ndarray, reference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(estimate - reference))))


def rmse_table(rows: dict[str, dict[str, float]]) -> str:
    """Markdown: a row per run, a column per quantity."""
    columns = list(dict.fromkeys(key for row in rows.values() for key in row))
    lines = ["| run | " + " | ".join(columns) + " |", "|---|" + "--:|" * len(columns)]
    for name, row in rows.items():
        lines.append(
            f"| {name} | " + " | ".join(f"{row[c]:.4g}" if c in row else "–" for c in columns) + " |"
        )
    return "\n".join(lines) + "\n"
