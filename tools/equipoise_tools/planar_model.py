"""A robot on a ball or two wheels in one plane: tilt and rolling of small motions, a log's 0.1 s ahead.

Coordinates: theta, tilt of the body; phi, rotation of ball or wheels against it, about the same axis.
Source: Lagrange's equations; the motor's torque, rotor inertia and friction act about phi.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid  # type: ignore[import-untyped]

STEP_S = 0.005
STICKS_RAD_S = 0.1  # below it Coulomb friction falls to zero: rest is not modelled
GRAVITY = 9.81
PAST = 6  # steps of the past that tell a rate: three rows at 100 Hz


@dataclass(frozen=True)
class Planar:
    """SI, about one axis; `rotor` and torques as seen about the ball or of both wheels together."""

    body_mass: float
    rolling_mass: float
    rolling_inertia: float
    body_inertia: float
    height: float
    radius: float
    rotor: float
    k1: float
    k2: float
    coulomb: float
    viscous: float
    delay_s: float = 0.0
    offset: float = 0.0  # of the logged tilt

    def accelerations(self, theta, phi_dot, drive):
        """Of theta and phi."""
        rolls = self.rolling_inertia + (self.rolling_mass + self.body_mass) * self.radius**2
        arm = self.body_mass * self.radius * self.height
        m11, m12 = rolls + self.rotor, rolls + arm
        m22 = rolls + 2 * arm + self.body_inertia + self.body_mass * self.height**2
        determinant = m11 * m22 - m12**2
        fall = self.body_mass * GRAVITY * self.height * (theta - self.offset)
        # A step of friction alone stops the wheels at most: else it throws those of a light robot to and fro.
        stops = max(STICKS_RAD_S, STEP_S * self.coulomb * m22 / determinant)
        friction = self.coulomb * np.tanh(phi_dot / stops) + self.viscous * phi_dot
        torque = self.k1 * drive - self.k2 * phi_dot - friction
        return (m11 * fall - m12 * torque) / determinant, (m22 * torque - m12 * fall) / determinant

    def predict(self, theta, theta_dot, phi, phi_dot, u):
        """Ahead by len(u) steps from arrays of states; u: steps x states."""
        half = 0.5 * STEP_S
        for drive in u:  # the midpoint rule
            a, b = self.accelerations(theta, phi_dot, drive)
            middle = theta + half * theta_dot, theta_dot + half * a, phi_dot + half * b
            theta, phi = theta + STEP_S * middle[1], phi + STEP_S * middle[2]
            a, b = self.accelerations(middle[0], middle[2], drive)
            theta_dot, phi_dot = theta_dot + STEP_S * a, phi_dot + STEP_S * b
        return theta, phi


def of_configuration(config: dict) -> Planar:
    """From the tables of a robot's configuration."""
    r = config["robot"]
    if r["type"] == "mbbr":
        return Planar(
            r["body_mass_kg"], r["ball_mass_kg"], r["ball_inertia_kg_m2"], r["body_inertia_kg_m2"][0],
            r["com_height_m"], r["ball_radius_m"], r["wheel_inertia_about_ball_kg_m2"], r["k1_N_m"],
            r["k2_ball_N_m_s"], r["coulomb_friction_N_m"], r["viscous_friction_N_m_s"],
        )  # fmt: skip
    return Planar(
        r["body_mass_kg"], 2 * r["wheel_mass_kg"], 2 * r["wheel_inertia_kg_m2"][0],
        r["body_inertia_kg_m2"][0], r["com_height_m"], r["wheel_radius_m"],
        2 * r["rotor_inertia_kg_m2"], 2 * r["k1_N_m"],
        2 * r["k2_N_m_s"], 2 * r["coulomb_friction_N_m"], 2 * r["viscous_friction_N_m_s"],
    )  # fmt: skip


@dataclass(frozen=True)
class Motion:
    """A log on a grid of STEP_S: one row per axis that it balances about."""

    theta: np.ndarray
    phi: np.ndarray
    u: np.ndarray
    used: np.ndarray  # steps that count

    def part(self, used: np.ndarray) -> Motion:
        return replace(self, used=self.used & used)


def fitted(values: np.ndarray, before: int, after: int, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Value and rate at each step of the polynomial through the steps around it."""
    k = np.arange(-before, after + 1)
    fit = np.linalg.pinv(np.vander(k, degree + 1, increasing=True))
    padded = np.pad(values, (before, after), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(k))
    return windows @ fit[0], windows @ fit[1] / STEP_S


def starts(motion: Motion, steps: int, every: int) -> np.ndarray:
    """Steps from which all until the prediction count."""
    n = motion.theta.shape[1]
    ok = np.convolve(motion.used, np.ones(steps + 1), "full")[steps : steps + n] > steps + 0.5
    return np.flatnonzero(ok)[::every]


def driven(u: np.ndarray, at: np.ndarray, steps: int, delay_s: float) -> np.ndarray:
    """Drive of the steps after each of `at`, delayed: steps x starts."""
    where = at[None, :] + np.arange(steps)[:, None] - delay_s / STEP_S
    return np.interp(where, np.arange(len(u)), u)


@dataclass(frozen=True)
class Start:
    at: np.ndarray
    theta: np.ndarray
    theta_dot: np.ndarray
    phi: np.ndarray
    phi_dot: np.ndarray


def states(motion: Motion, steps: int, around: int, every: int) -> list[Start]:
    at = starts(motion, steps, every)
    axes = range(len(motion.theta))
    cubics = [[fitted(x[i], around, around, 3) for x in (motion.theta, motion.phi)] for i in axes]
    return [Start(at, *(x[at] for pair in both for x in pair)) for both in cubics]


def latest(p: Planar, theta: np.ndarray, phi: np.ndarray, u: np.ndarray) -> list[np.ndarray]:
    """Theta, phi and their rates at each step: straight lines through what the model leaves of the past."""
    drive = driven(u, np.arange(len(u)), 1, p.delay_s)[0]
    out = []
    accelerations = p.accelerations(theta, fitted(phi, PAST, 0, 1)[1], drive)
    for values, acceleration in zip((theta, phi), accelerations, strict=True):
        rate = cumulative_trapezoid(acceleration, dx=STEP_S, initial=0.0)
        known = cumulative_trapezoid(rate, dx=STEP_S, initial=0.0)
        value, slope = fitted(values - known, PAST, 0, 1)
        out += [value + known, slope + rate]
    return out


def ahead(model: list[Planar], motion: Motion, horizon_s: float = 0.1) -> dict[str, dict[str, float]]:
    """RMS of what each prediction from past samples alone is wrong by, rad: tilt and wheels (or ball)."""
    steps = round(horizon_s / STEP_S)
    errors: dict[str, list[np.ndarray]] = {}
    at = starts(motion, steps, 1)
    for p, theta, phi, u in zip(model, motion.theta, motion.phi, motion.u, strict=True):
        now = [x[at] for x in latest(p, theta, phi, u)]
        lines = [fitted(x, PAST, 0, 1) for x in (theta, phi)]
        guesses = {
            "model": p.predict(*now, driven(u, at, steps, p.delay_s)),
            "persistence": (theta[at], phi[at]),
            "constant_rate": [value[at] + steps * STEP_S * rate[at] for value, rate in lines],
        }
        for name, guess in guesses.items():
            for what, g, true in zip(("tilt", "wheel"), guess, (theta, phi), strict=True):
                errors.setdefault(f"{name} {what}", []).append(g - true[at + steps])
    rms = {k: float(np.sqrt(np.mean(np.square(np.concatenate(v))))) for k, v in errors.items()}
    return {
        n: {w: rms[f"{n} {w}"] for w in ("tilt", "wheel")} for n in ("model", "persistence", "constant_rate")
    }
