"""Controllers of the field in our own code, each in the place of the pipeline's estimator and feedback.

Numbers that a designer would choose are defaults times factors, which `tuning` searches.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec

import numpy as np
from scipy.linalg import expm, solve_discrete_are  # type: ignore[import-untyped]

from .. import published, tune
from ..planar_model import STEP_S
from .policy import Policy
from .sensing import Known, Senses

MAX_LEAN_RAD = 0.3  # as [controller.*] of the eduMIP
MOST_U = 2.0
YAW_RAD_S, YAW_DAMPING = 6.0, 1.0  # of the yaw loop before its factor
Factors = dict[str, float]


def clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def discrete(robot: Known) -> tuple[np.ndarray, np.ndarray]:
    """The plane's model over a tick with u held."""
    block = np.zeros((5, 5))
    block[:4, :4], block[:4, 4] = robot.a, robot.b
    step = expm(block * STEP_S)
    return step[:4, :4], step[:4, 4:]


def weights(factors: Factors) -> np.ndarray:
    """Bryson's rule: deviations of tilt, roll and rates that are worth one unit of u."""
    worth = 0.125 / factors["tilt"], 5.0 / factors["travel"], 3.0, 60.0 / factors["speed"]
    return np.diag([1.0 / w**2 for w in worth])


def lqr(robot: Known, factors: Factors) -> list[float]:
    """K of u = K (reference - state, minus u of the last tick, which reaches the motors in this one)."""
    a, b = np.zeros((5, 5)), np.eye(5)[:, 4:]
    a[:4, :4], a[:4, 4:] = discrete(robot)
    q = np.zeros((5, 5))
    q[:4, :4] = weights(factors)
    p = solve_discrete_are(a, b, q, np.eye(1))
    return np.linalg.solve(np.eye(1) + b.T @ p @ b, b.T @ p @ a)[0].tolist()


class Feedback:
    """What all have: yaw by proportion and rate with the speed held; a new start after motors off."""

    def __init__(self, robot: Known, senses: Senses, factors: Factors) -> None:
        self.robot, self.senses = robot, senses
        omega = YAW_RAD_S * factors.get("yaw", 1.0)
        self.k_yaw = omega**2 / robot.yaw_gain
        self.k_yaw_rate = 2.0 * YAW_DAMPING * omega / robot.yaw_gain
        self.was_held = True

    def __call__(self, tick) -> list[float]:
        was_held, self.was_held = self.was_held, self.senses.held
        if self.was_held:
            return [0.0] * (self.robot.axes + 1)
        if was_held:
            self.restart()
        return self.drive(tick)

    def drive(self, tick) -> list[float]:
        error = tick.error.tolist()[-2:]
        wanted = float(tick.reference.omega_B_rad_s[2])
        rates = tick.reference.phi_dot_rad_s.tolist()
        u = [clamp(self.axis(i, e, rates[i]), MOST_U) for i, e in enumerate(self.senses.errors(tick))]
        return [*u, self.k_yaw * error[0] + self.k_yaw_rate * error[1] + self.robot.yaw_hold_s * wanted]

    def restart(self) -> None:
        pass

    def axis(self, i: int, error: tuple, rate: float) -> float:
        raise NotImplementedError


class CascadePid(Feedback):
    """librobotcontrol's rc_balance and ArduPilot's balance bot: a loop of the travel sets the lean, a PID of
    the lean the motors; steering beside it. Tilt is the IMU's own."""

    def __init__(self, robot: Known, factors: Factors) -> None:
        super().__init__(robot, Senses(robot, packets=True, tilt_s=1.0, rate_s=0.01), factors)
        theta, roll, theta_dot, roll_dot, _ = lqr(robot, dict.fromkeys(("tilt", "travel", "speed"), 1.0))
        self.p, self.d = theta * factors["P"], theta_dot * factors["D"]
        self.i = theta * factors["I"]  # a second's reset time
        self.speed, self.travel = roll_dot / theta * factors["speed"], roll / theta * factors["travel"]
        self.restart()

    def restart(self) -> None:
        self.sums = [0.0, 0.0]

    def axis(self, i: int, error: tuple, rate: float) -> float:
        lean = clamp(self.speed * error[3] + self.travel * error[1], MAX_LEAN_RAD)
        off = lean + error[0]
        limit = 0.5 * MOST_U / abs(self.i)  # the sum does not wind up
        self.sums[i] = clamp(self.sums[i] + STEP_S * off, limit)
        return self.p * off + self.i * self.sums[i] + self.d * error[2]


class Lqr(Feedback):
    """State feedback on a complementary filter, the speed held against back-EMF."""

    def __init__(self, robot: Known, factors: Factors) -> None:
        senses = Senses(robot, packets=False, tilt_s=2.0 * factors["filter"], rate_s=0.01 * factors["rates"])
        super().__init__(robot, senses, factors)
        self.k = lqr(robot, factors)
        self.restart()

    def restart(self) -> None:
        self.before = [0.0, 0.0]  # u of the feedback

    def axis(self, i: int, error: tuple, rate: float) -> float:
        theta, roll, theta_dot, roll_dot, before = self.k
        pull = clamp(roll * error[1], abs(theta) * MAX_LEAN_RAD)
        feedback = theta * error[0] + pull + theta_dot * error[2] + roll_dot * error[3]
        self.before[i] = feedback = clamp(feedback - before * self.before[i], MOST_U)
        return feedback + self.robot.hold_s * rate


Quat = tuple[float, float, float, float]  # w, x, y, z


def tilted(x: float, y: float) -> Quat:
    """Ry Rx."""
    cx, sx, cy, sy = math.cos(x / 2), math.sin(x / 2), math.cos(y / 2), math.sin(y / 2)
    return cy * cx, cy * sx, sy * cx, -sy * sx


def between(there: Quat, wanted: Quat) -> Quat:
    """conj(there) * wanted."""
    (w, x, y, z), (a, b, c, d) = there, wanted
    return (
        w * a + x * b + y * c + z * d,
        w * b - x * a - y * d + z * c,
        w * c + x * d - y * a - z * b,
        w * d - x * c + y * b - z * a,
    )


class Sliding(Lqr):
    """Sliding mode of the attitude's quaternion error about a reference that an LQR of the travel sets, after
    Kugle's papers; one tilt at a time is its plane."""

    def __init__(self, robot: Known, factors: Factors) -> None:
        super().__init__(robot, {**dict.fromkeys(("tilt", "travel", "speed"), 1.0), **factors})
        theta, roll, theta_dot, roll_dot, _ = self.k
        self.outer = roll_dot / theta * factors["speed"], roll / theta * factors["travel"]
        self.slope = theta / theta_dot * factors["slope"]  # 1/s: theta' = -slope theta on the surface
        self.reach = abs(theta_dot * robot.b[2]) * factors["reach"]  # 1/s, linear within the boundary
        self.boundary = 0.5 * factors["boundary"]  # rad/s

    def __call__(self, tick) -> list[float]:
        errors = self.senses.errors(tick)
        wanted = [clamp(self.outer[0] * e[3] + self.outer[1] * e[1], MAX_LEAN_RAD) for e in errors]
        self.off = self.vector(wanted, [-e[0] for e in errors])
        return super().__call__(tick)

    @staticmethod
    def vector(wanted: list[float], there: list[float]) -> list[float]:
        """Twice the tilts of the vector part from one attitude to the other."""
        _, x, y, _ = between(tilted(*[*there, 0.0][:2]), tilted(*[*wanted, 0.0][:2]))
        return [2 * x, 2 * y]

    def axis(self, i: int, error: tuple, rate: float) -> float:
        surface = error[2] + self.slope * self.off[i]
        asked = self.slope * error[2] + self.reach * self.boundary * clamp(surface / self.boundary, 1.0)
        a, theta, theta_dot = self.robot.a[2], -error[0], -error[2]
        natural = a[0] * theta + a[2] * theta_dot + a[3] * (rate - error[3])
        return float((asked - natural) / self.robot.b[2])


class Quaternion(Lqr):
    """LQR of the attitude's quaternion error, rates and travel, after Kugle's papers: tilts and yaw are one
    linear model about the wanted spin, with one gain matrix."""

    def __init__(self, robot: Known, factors: Factors) -> None:
        super().__init__(robot, factors)
        self.factors = factors
        self.gains: dict[int, np.ndarray] = {}  # by spin in rad/s
        self.most = MAX_LEAN_RAD * abs(self.k[0] / self.k[1])  # rad of travel

    def solve(self, spin: float) -> np.ndarray:
        """State: twice the quaternion's vector part, body rates, travel, its rate, u of the last tick."""
        robot, factors = self.robot, self.factors
        n, m = robot.axes, robot.axes + 1
        size = 2 * m + 2 * n
        block, q = np.zeros((size + m, size + m)), np.zeros((size + m, size + m))
        for i in range(n):
            state = [i, 2 * m + i, m + i, 2 * m + n + i]  # as the plane has it
            block[np.ix_(state, state)], block[state, size + i] = robot.a, robot.b
            q[np.ix_(state, state)] = weights({**factors, "tilt": 2.0 * factors["tilt"]})  # spinning needs it
        for i in (0, m, 2 * m, 2 * m + n) if n == 2 else ():  # what stays as it is turns in the body's axes
            block[i, i + 1] += spin
            block[i + 1, i] -= spin
        block[n, n + m], block[n + m, size + n] = 1.0, robot.yaw_gain
        q[n, n], q[n + m, n + m] = (factors["yaw"] / 0.5) ** 2, 1.0 / 5.0**2  # rad, rad/s
        a, b = expm(block * STEP_S), np.eye(size + m)[:, size:]
        a[size:] = 0.0
        p = solve_discrete_are(a, b, q, np.eye(m))
        return np.linalg.solve(np.eye(m) + b.T @ p @ b, b.T @ p @ a)

    def restart(self) -> None:
        self.before = [0.0] * (self.robot.axes + 1)

    def drive(self, tick) -> list[float]:
        errors, n = self.senses.errors(tick), self.robot.axes
        x, y = [*(-e[0] for e in errors), 0.0][:2]
        w, *vector = self.error(x, y, float(tick.error[-2]))
        spin = float(tick.reference.omega_B_rad_s[2])
        up = -math.sin(y), math.sin(x) * math.cos(y), math.cos(x) * math.cos(y)  # the world's, in the body
        rates = [spin * a - b for a, b in zip(up, self.senses.omega, strict=True)]
        kept = [0, 1, 2] if n == 2 else [0, 2]
        state = [math.copysign(2.0, w) * vector[i] for i in kept] + [rates[i] for i in kept]
        state += [clamp(e[1], self.most) for e in errors] + [e[3] for e in errors]
        near = round(spin)
        if near not in self.gains:
            self.gains[near] = self.solve(near)
        u = self.gains[near] @ [*state, *(-b for b in self.before)]
        self.before = [clamp(value, MOST_U) for value in u.tolist()]
        wanted = tick.reference.phi_dot_rad_s.tolist()
        held = [self.robot.hold_s * wanted[i] for i in range(n)] + [self.robot.yaw_hold_s * spin]
        return [a + b for a, b in zip(self.before, held, strict=True)]

    @staticmethod
    def error(x: float, y: float, heading: float) -> Quat:
        """From there to upright, turned by the heading's error."""
        return between(tilted(x, y), (math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)))


class Predictive(Lqr):
    """Linear MPC by TinyMPC, an axis at a time: limits on u and tilt for 0.1 s, the LQR's cost after."""

    HORIZON, ROUNDS, RHO = 20, 10, 0.03  # ADMM's, on states scaled to a weight of 1

    def __init__(self, robot: Known, factors: Factors) -> None:
        self.a, self.b = discrete(robot)
        self.scale = np.sqrt(np.diag(weights(factors)))
        super().__init__(robot, factors)

    def restart(self) -> None:
        super().restart()
        self.solvers = [self.solver() for _ in range(self.robot.axes)]

    def solver(self):
        import tinympc  # type: ignore[import-not-found]

        solver, free = tinympc.TinyMPC(), np.full(4, 1e6)
        a, b = self.a * self.scale[:, None] / self.scale, self.b * self.scale[:, None]
        # Never asked whether it has converged, which it would print at every tick.
        rounds = {"max_iter": self.ROUNDS, "check_termination": self.ROUNDS + 1}
        solver.setup(a, b, np.eye(4), np.eye(1), self.HORIZON, rho=self.RHO, **rounds)
        free[0] = MAX_LEAN_RAD * self.scale[0]
        solver.set_bound_constraints(-free, free, np.array([-MOST_U]), np.array([MOST_U]))
        return solver

    def axis(self, i: int, error: tuple, rate: float) -> float:
        travel = clamp(error[1], abs(self.k[0] / self.k[1]) * MAX_LEAN_RAD)
        state = -np.array([error[0], travel, error[2], error[3]])
        state = self.a @ state + self.b[:, 0] * self.before[i]  # when this u reaches the motors
        self.solvers[i].set_x0(self.scale * state)
        self.before[i] = clamp(float(self.solvers[i].solve()["controls"][0]), MOST_U)
        return self.before[i] + self.robot.hold_s * rate


@dataclass(frozen=True)
class Peer:
    """`knobs`: what the search may scale, and its bounds; `make`: where it is none of the firmware's own."""

    name: str
    knobs: dict[str, tuple[float, float]] = field(default_factory=dict)
    make: Callable[[Known, Factors], Feedback | Policy] | None = None


WIDE = (0.25, 4.0)
OF_LQR = dict.fromkeys(("tilt", "travel", "speed", "filter", "rates", "yaw"), WIDE)
OURS, SHIPPED, DISSERTATION, POLICY = "ours", "shipped", "dissertation", "policy"
PEERS = {
    peer.name: peer
    for peer in (
        Peer(OURS),
        Peer(SHIPPED),  # ours before the search
        Peer(DISSERTATION),  # as published: nothing to search
        Peer("pid", dict.fromkeys(("P", "I", "D", "speed", "travel", "yaw"), WIDE), CascadePid),
        Peer("lqr", OF_LQR, Lqr),
        Peer("quaternion", OF_LQR, Quaternion),
        Peer("mpc", OF_LQR, Predictive),
        Peer(POLICY, make=Policy),  # trained: nothing to search
        Peer(
            "sliding",
            dict.fromkeys(("slope", "reach", "boundary", "speed", "travel", "filter", "rates", "yaw"), WIDE),
            Sliding,
        ),
    )
}


def available(name: str) -> bool:
    return name != "mpc" or find_spec("tinympc") is not None


def knobs_of(peer: Peer, kind: str) -> dict[str, tuple[float, float]]:
    if peer.name == OURS:
        return {knob.name: (knob.low, knob.high) for knob in tune.KNOBS[kind]}
    return peer.knobs


# The firmware's own filters that cannot name a lying encoder shake each wheel after arming: no peer's idea.
# Nor is what it gives back to the bridges: peers were published and searched for without.
# The estimator that runs beside a peer's and is heard by nobody is the cheapest.
BESIDE = {"mbbr": ("truth", "thesis"), "mip": ("truth", "lqr")}
ALONE = "safety.encoder_check_drive=0.0", "motor.bridge_lost_s=0.0"


def choice(peer: Peer, kind: str, config: dict, factors: Factors) -> tuple[str, str, list[str]]:
    """Estimator, controller and settings of the firmware."""
    if peer.name in (OURS, SHIPPED):
        return "", "", tune.settings(config, tune.KNOBS[kind], factors) if factors else []
    if peer.name == POLICY:  # behind the estimator and detector that it was trained with
        return "", "", []
    if peer.make is not None:
        return (*BESIDE[kind], [*ALONE])
    if kind == "mip":  # its robot's library, on the IMU's own tilt: of [T]'s filters it lasts longest here
        return "attitude", "slc", ["controller.slc.published=true", *ALONE]
    told = {**published.kf(), **published.gains("Table 6.3")}  # 6.4.6: outlasts its EKF
    return "kf_attitude", "thesis", [*(f"{k}={v}" for k, v in told.items()), *ALONE]
