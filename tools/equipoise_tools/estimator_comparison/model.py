"""The MBBR's filter model as NumPy functions, from the derivation's SymPy expressions.

The readable form is MbbrEkfModel (src/robots/mbbr/ekf.cpp). States come first: x[i] is an array over
runs, or over sigma points and runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from derive import mbbr_filter, mbbr_header
from derive.filter_header import DT

STATES = mbbr_filter.STATES
AT = mbbr_filter.AT
N, MOTION, ROWS, GRAVITY = len(STATES), 10, 8, 9.8
GROUPS = {"gyro": slice(0, 3), "wheels": slice(3, 6), "accelerometer": slice(6, 8)}
MOVED = mbbr_filter.MOVED
E, PHI, U = slice(2, 5), slice(8, 10), slice(15, 18)
SCALE = AT["scale"]


@dataclass(frozen=True)
class Robot:
    """What the filter is told of its robot, its noise and its clock."""

    parameters: tuple[tuple[str, float], ...]  # of the derivation
    T_ob: np.ndarray
    lever_arm: np.ndarray
    time_constant_s: float
    age_s: float
    q: np.ndarray
    r: np.ndarray
    input_variance: np.ndarray
    initial_variance: np.ndarray

    def value(self, name: str) -> float:
        return dict(self.parameters)[name]


def wheel_axes(latitude_deg: float, azimuth_deg: float) -> np.ndarray:
    """[T] (2.3)-(2.5), columns, with the tilt that makes them orthogonal."""
    alpha, azimuth = np.radians([latitude_deg, azimuth_deg])
    cos_beta = 1.0 / (np.sqrt(3.0) * np.sin(alpha))
    first = cos_beta * np.array([np.cos(alpha), 0.0, np.sin(alpha)])
    first[1] -= np.sqrt(1.0 - cos_beta**2)
    turns = azimuth + 2.0 * np.pi / 3.0 * np.arange(3)
    c, s = np.cos(turns), np.sin(turns)
    return np.stack([c * first[0] - s * first[1], s * first[0] + c * first[1], np.full(3, first[2])])


def robot_of(config: dict, fidelity: str = "full", **changed: float) -> Robot:
    """Of a run's configuration and world; `changed`: parameters that the filter is told wrongly."""
    filtered = config["world"][fidelity]["disturbance"]["imu_low_pass"] > 0
    r, e = config["robot"], config["estimator"]["ekf"]
    I_t1, I_t2, I_t3 = r["body_inertia_kg_m2"]
    named = {
        "m_t": r["body_mass_kg"],
        "m_b": r["ball_mass_kg"],
        "r": r["ball_radius_m"],
        "r_w": r["wheel_radius_m"],
        "l": r["com_height_m"],
        "l_az": r["imu_position_m"][2],
        "I_t1": I_t1,
        "I_t2": I_t2,
        "I_t3": I_t3,
        "I_b": r["ball_inertia_kg_m2"],
        "I_w": r["wheel_inertia_about_ball_kg_m2"],
        "k1": r["k1_N_m"],
        "k2_ball": r["k2_ball_N_m_s"],
        "mu_v": r["viscous_friction_N_m_s"],
        "g": GRAVITY,
    }
    return Robot(
        parameters=tuple((named | changed).items()),
        T_ob=wheel_axes(r["wheel_latitude_deg"], r["wheel_azimuth_deg"]),
        lever_arm=np.array(r["imu_position_m"][:2]),
        time_constant_s=e["disturbance_time_constant_s"],
        age_s=config["chain"]["gyro_delay_s"] if filtered else 0.0,
        q=np.array(e["q"]),
        r=np.array(e["r"]),
        input_variance=np.array(e["input_variance"]),
        initial_variance=np.square(e["initial_sigma"]),
    )


def _entries(arguments, expressions: dict):
    """f(*values) -> {place: value} of what is not zero."""
    kept = {place: e for place, e in expressions.items() if e != 0}
    f = sp.lambdify(arguments, list(kept.values()), "numpy", cse=True)
    return lambda *values: zip(kept, f(*values), strict=True)


@dataclass(frozen=True)
class Functions:
    """Of (coefficients, motion, torques), but for the first, which is of the parameters by name."""

    coefficients: Callable
    names: tuple[str, ...]
    rate: Callable
    rate_jacobian: Callable
    rate_by_torque: Callable
    accel: Callable
    accel_jacobian: Callable


@lru_cache(maxsize=1)
def functions() -> Functions:
    """The derivation's expressions, with the coefficients' names as the firmware has them."""
    model = mbbr_header.model()
    parameters = {name: sp.Symbol(name, positive=True) for name in model.parameters}
    named: dict[str, sp.Expr] = {}

    def rows(index: int):
        out = []
        for name, e in zip(model.rows[index].names, model.rows[index].expressions, strict=True):
            terms = model.terms(e)
            named.update({f"{name}_{label}": value for label, _, value in terms})
            out.append(sum(sp.Symbol(f"{name}_{label}") * monomial for label, monomial, _ in terms))
        return out

    tx, ty, dtx, dty, dtz, px, py = model.state
    a, accel = rows(0), rows(1)
    lumped = {sp.Symbol(k, positive=True): e for k, e in model.lumped.items()}
    determinants = {sp.Symbol(k): e for k, e in model.denominators.items()}
    values = [e.subs(determinants).subs(lumped) for e in named.values()]
    motion = (tx, ty, *sp.symbols("ex ey ez"), dtx, dty, dtz, px, py)
    # phi*' lives in a frame that turns; the sums: [T] (5.31).
    sums = [px + ty * dtz, py - tx * dtz, ty * px - tx * py - dtz]
    rate = [dtx, dty, *sums, *a[:3], a[3] + dtz * py, a[4] - dtz * px]
    arguments = (tuple(sp.Symbol(name) for name in named), motion, model.inputs)
    J = {(i, j): sp.diff(f, v) for i, f in enumerate(rate) for j, v in enumerate(motion)}
    G = {(i, j): sp.diff(f, v) for i, f in enumerate(rate) for j, v in enumerate(model.inputs)}
    H = {(i, MOVED[j]): sp.diff(f, v) for i, f in enumerate(accel) for j, v in enumerate(model.state)}
    return Functions(
        sp.lambdify([tuple(parameters.values())], values, "math"),
        tuple(named),
        sp.lambdify(arguments, rate, "numpy", cse=True),
        _entries(arguments, J),
        _entries(arguments, G),
        sp.lambdify(arguments, accel, "numpy", cse=True),
        _entries(arguments, H),
    )


class Model:
    """Process and measurement of the 18 states."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._f = functions()
        known = dict(robot.parameters)
        self._c = tuple(self._f.coefficients([known[name] for name in mbbr_header.model().parameters]))
        numbers = dict(zip(self._f.names, self._c, strict=True))
        self._accel_u = numbers["accel_x_uy"], numbers["accel_y_ux"]
        self.keep = np.exp(-DT / robot.time_constant_s)
        self.W = robot.value("r") / robot.value("r_w") * robot.T_ob.T
        zero = np.zeros((MOTION, 3))
        self.B = self.ahead(zero, np.eye(3), DT) - self.ahead(zero, np.zeros((3, 3)), DT)
        B = np.zeros((N, 3))
        B[:MOTION] = self.B
        self.Q = B @ np.diag(robot.input_variance) @ B.T + np.diag(robot.q)
        self.R = np.diag(robot.r)

    def rate(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        out = np.empty((MOTION, *x.shape[1:]))
        for i, value in enumerate(self._f.rate(self._c, x, u)):
            out[i] = value
        return out

    def _rate_and_jacobian(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        A = np.zeros((x.shape[1], MOTION, MOTION))
        for (i, j), value in self._f.rate_jacobian(self._c, x, u):
            A[:, i, j] = value
        return self.rate(x, u), A

    def ahead(self, x: np.ndarray, u: np.ndarray, dt: float) -> np.ndarray:
        """The motion after dt, by Heun's third-order rule."""
        first = self.rate(x, u)
        second = self.rate(x + dt / 3.0 * first, u)
        third = self.rate(x + 2.0 * dt / 3.0 * second, u)
        return x + dt / 4.0 * (first + 3.0 * third)

    def _ahead_and_jacobian(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        one = np.eye(MOTION)
        first, A_first = self._rate_and_jacobian(x, u)
        second, A = self._rate_and_jacobian(x + DT / 3.0 * first, u)
        slope = 2.0 * DT / 3.0 * A @ (one + DT / 3.0 * A_first) + one
        third, A = self._rate_and_jacobian(x + 2.0 * DT / 3.0 * second, u)
        F = 0.75 * DT * A @ slope + one + 0.25 * DT * A_first
        return x + DT / 4.0 * (first + 3.0 * third), F

    def input_jacobian(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """d(motion after a tick)/d(torques felt) where the robot is; the firmware's B: upright at rest."""
        felt = u + x[U]

        def at(motion: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            G = np.zeros((x.shape[1], MOTION, 3))
            for (i, j), value in self._f.rate_by_torque(self._c, motion, felt):
                G[:, i, j] = value
            return *self._rate_and_jacobian(motion, felt), G

        first, _, G_first = at(x[:MOTION])
        second, A, G = at(x[:MOTION] + DT / 3.0 * first)
        slope = G + DT / 3.0 * A @ G_first
        _, A, G = at(x[:MOTION] + 2.0 * DT / 3.0 * second)
        B = DT / 4.0 * (G_first + 3.0 * (G + 2.0 * DT / 3.0 * A @ slope))
        B[:, E] *= (1.0 + x[SCALE])[:, None, None]
        return B

    def step(self, x: np.ndarray, u: np.ndarray, plane_scale: np.ndarray) -> np.ndarray:
        """x after a tick. plane_scale: of the sums about x and y, which the filters do not learn from."""
        out = x.copy()
        out[:MOTION] = self.ahead(x[:MOTION], u + x[U], DT)
        return self._finish(x, out, plane_scale)

    def _finish(self, x: np.ndarray, out: np.ndarray, plane_scale: np.ndarray) -> np.ndarray:
        """The sums as counted, and the disturbance, whose x and y stand in the world frame."""
        moved = out[E] - x[E]
        out[2:4] += plane_scale * moved[:2]
        out[4] += x[SCALE] * moved[2]
        turn = DT * x[AT["dtz"]]
        c, s = self.keep * np.cos(turn), self.keep * np.sin(turn)
        out[15], out[16] = c * x[15] + s * x[16], c * x[16] - s * x[15]
        out[17] = self.keep * x[17]
        return out

    def predict(self, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x after a tick and the firmware's F."""
        out = x.copy()
        out[:MOTION], F_motion = self._ahead_and_jacobian(x[:MOTION], u + x[U])
        step_z = out[4] - x[4]
        out = self._finish(x, out, x[SCALE])
        F = np.tile(np.eye(N), (x.shape[1], 1, 1))
        F_motion[:, E] *= (1.0 + x[SCALE])[:, None, None]
        F_motion[:, E, E] = np.eye(3)
        F[:, :MOTION, :MOTION] = F_motion
        F[:, 4, SCALE] = step_z
        F[:, :MOTION, U] = self.B
        turn = DT * x[AT["dtz"]]
        c, s = self.keep * np.cos(turn), self.keep * np.sin(turn)
        F[:, 15, 15], F[:, 15, 16], F[:, 16, 15], F[:, 16, 16] = c, s, -s, c
        F[:, 17, 17] = self.keep
        return out, F

    def measure(self, x: np.ndarray, u: np.ndarray, plane_scale: np.ndarray) -> np.ndarray:
        """What gyro, wheels and accelerometer should read."""
        tx, ty, ex, ey, ez, dtx, dty, dtz, _, _, mx, my, bx, by = x[:14]
        rate_x, rate_y, rate_z = dtx - ty * dtz, dty + tx * dtz, dtz - tx * dty
        y = np.empty((ROWS, *x.shape[1:]))
        y[0] = rate_x + bx - my * rate_z
        y[1] = rate_y + by + mx * rate_z
        y[2] = rate_z * (1.0 - 0.5 * (mx * mx + my * my)) - mx * rate_y + my * rate_x
        ball = np.stack([ex - (1.0 + plane_scale) * tx, ey - (1.0 + plane_scale) * ty, ez])
        y[3:6] = np.tensordot(self.W, ball, 1)
        accel = self._f.accel(self._c, x[:MOTION], u + x[U])
        for i, mount in enumerate((my, -mx)):
            y[6 + i] = accel[i] + GRAVITY * mount + dtz * dtz * self.robot.lever_arm[i]
        return y

    def measure_jacobian(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The firmware's H: products of small quantities are left out of the gyro's rows."""
        tx, ty, _, _, _, dtx, dty, dtz, _, _, mx, my = x[:12]
        rate_x, rate_y, rate_z = dtx - ty * dtz, dty + tx * dtz, dtz - tx * dty
        gyro = (
            {"dtx": 1.0, "ty": -dtz, "dtz": -ty - my, "bx": 1.0, "my": -rate_z},
            {"dty": 1.0, "tx": dtz, "dtz": tx + mx, "by": 1.0, "mx": rate_z},
            {
                "dtz": 1.0 - 0.5 * (mx * mx + my * my),
                "tx": -dty - mx * dtz,
                "ty": -my * dtz,
                "dty": -tx - mx,
                "dtx": my,
                "mx": -rate_y - mx * rate_z,
                "my": rate_x - my * rate_z,
            },
        )
        H = np.zeros((x.shape[1], ROWS, N))
        for i, row in enumerate(gyro):
            for name, value in row.items():
                H[:, i, AT[name]] = value
        H[:, 3:6, E] = self.W
        H[:, 3:6, :2] = -(1.0 + x[SCALE])[:, None, None] * self.W[:, :2]
        for (i, j), value in self._f.accel_jacobian(self._c, x[:MOTION], u + x[U]):
            H[:, 6 + i, j] = value
        H[:, 6:8, AT["dtz"]] += 2.0 * dtz[:, None] * self.robot.lever_arm
        H[:, 6, AT["uy"]], H[:, 7, AT["ux"]] = self._accel_u
        H[:, 6, AT["my"]], H[:, 7, AT["mx"]] = GRAVITY, -GRAVITY
        return H
