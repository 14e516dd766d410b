"""A robot on a ball or two wheels in one plane: tilt and rolling of small motions, a log's 0.1 s ahead.

Coordinates: theta, tilt of the body; phi, rotation of ball or wheels against it, about the same axis.
Source: Lagrange's equations; the motor's torque, rotor inertia and friction act about phi.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

STEP_S = 0.005
STICKS_RAD_S = 0.1  # below it Coulomb friction falls to zero: rest is not modelled
GRAVITY = 9.81


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

    def predict(self, theta, theta_dot, phi, phi_dot, u):
        """Ahead by len(u) steps from arrays of states; u: steps x states."""
        rolls = self.rolling_inertia + (self.rolling_mass + self.body_mass) * self.radius**2
        arm = self.body_mass * self.radius * self.height
        m11, m12 = rolls + self.rotor, rolls + arm
        m22 = rolls + 2 * arm + self.body_inertia + self.body_mass * self.height**2
        determinant = m11 * m22 - m12**2
        weight = self.body_mass * GRAVITY * self.height
        theta = theta - self.offset

        def change(part, theta, phi_dot, drive):
            """What the rates change by in a part of a step."""
            friction = self.coulomb * np.tanh(phi_dot / STICKS_RAD_S) + self.viscous * phi_dot
            torque, fall = self.k1 * drive - self.k2 * phi_dot - friction, weight * theta
            step = part * STEP_S / determinant
            return step * (m11 * fall - m12 * torque), step * (m22 * torque - m12 * fall)

        for drive in u:  # the midpoint rule
            a, b = change(0.5, theta, phi_dot, drive)
            middle = theta + 0.5 * STEP_S * theta_dot, theta_dot + a, phi_dot + b
            theta, phi = theta + STEP_S * middle[1], phi + STEP_S * middle[2]
            a, b = change(1.0, middle[0], middle[2], drive)
            theta_dot, phi_dot = theta_dot + a, phi_dot + b
        return theta + self.offset, phi


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


def polynomial(values: np.ndarray, before: int, after: int) -> tuple[np.ndarray, np.ndarray]:
    """Value and rate at each step of the parabola through its past, of the cubic through past and future."""
    k = np.arange(-before, after + 1)
    fit = np.linalg.pinv(np.vander(k, 4 if after else 3, increasing=True))
    padded = np.pad(values, ((0, 0), (before, after)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(k), axis=1)
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


def states(motion: Motion, steps: int, window: tuple[int, int], every: int) -> list[Start]:
    at = starts(motion, steps, every)
    theta, theta_dot = polynomial(motion.theta, *window)
    phi, phi_dot = polynomial(motion.phi, *window)
    return [Start(at, *(x[axis, at] for x in (theta, theta_dot, phi, phi_dot))) for axis in range(len(theta))]


def ahead(model: list[Planar], motion: Motion, horizon_s: float = 0.1) -> dict[str, dict[str, float]]:
    """RMS of what each prediction from past samples alone is wrong by, rad: tilt and wheels (or ball)."""
    steps = round(horizon_s / STEP_S)
    errors: dict[str, list[np.ndarray]] = {}
    for axis, s in enumerate(states(motion, steps, (20, 0), 1)):
        p = model[axis]
        then = motion.theta[axis, s.at + steps], motion.phi[axis, s.at + steps]
        t = steps * STEP_S
        guesses = {
            "model": p.predict(
                s.theta, s.theta_dot, s.phi, s.phi_dot, driven(motion.u[axis], s.at, steps, p.delay_s)
            ),
            "persistence": (motion.theta[axis, s.at], motion.phi[axis, s.at]),
            "constant_rate": (s.theta + t * s.theta_dot, s.phi + t * s.phi_dot),
        }
        for name, guess in guesses.items():
            for what, g, true in zip(("tilt", "wheel"), guess, then, strict=True):
                errors.setdefault(f"{name} {what}", []).append(g - true)
    rms = {k: float(np.sqrt(np.mean(np.square(np.concatenate(v))))) for k, v in errors.items()}
    return {
        n: {w: rms[f"{n} {w}"] for w in ("tilt", "wheel")} for n in ("model", "persistence", "constant_rate")
    }
