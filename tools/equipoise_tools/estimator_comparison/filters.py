"""Three filters of one model and one noise, each over many runs at once: extended, unscented, error-state.

A step is predict(u) and update(u, y, use); x holds the model's states, heading_rad what the yaw rate adds
up to. nu: innovations, whitened in the order of the rows, so that their squares are the firmware's row_nis().
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .model import AT, DT, MOTION, PHI, ROWS, SCALE, Model, N, U

TURN = AT["dtz"]
RATES = slice(5, 8)


class Extended:
    """As the firmware's default filter without pushes and slips; all rows at once."""

    name: ClassVar[str] = "extended"
    errors: ClassVar[int] = N

    def __init__(self, model: Model, x: np.ndarray) -> None:
        self.model = model
        self.x = x.copy()
        count = x.shape[1]
        self.P = np.zeros((count, self.errors, self.errors))
        self.P[:, range(N), range(N)] = model.robot.initial_variance
        self.heading_rad = np.zeros(count)
        self.nu = np.zeros((ROWS, count))

    def predict(self, u: np.ndarray) -> None:
        rate = self.x[TURN].copy()
        self._propagate(u)
        self.P = 0.5 * (self.P + self.P.transpose(0, 2, 1))  # an asymmetry grows with the unstable robot
        self.heading_rad = self.heading_rad + 0.5 * DT * (rate + self.x[TURN])

    def _propagate(self, u: np.ndarray) -> None:
        self.x, F = self.model.predict(self.x, u)
        self.P = F @ self.P @ F.transpose(0, 2, 1) + self.model.Q

    def update(self, u: np.ndarray, y: np.ndarray, use: np.ndarray) -> None:
        """use: which rows count."""
        H = self._H(u) * use.T[..., None]
        PH = self.P @ H.transpose(0, 2, 1)
        innovation = use * (y - self.model.measure(self.x, u, self.x[SCALE]))
        self._correct(H @ PH + self.model.R, PH, innovation.T)

    def _H(self, u: np.ndarray) -> np.ndarray:
        return self.model.measure_jacobian(self.x, u)

    def _correct(self, S: np.ndarray, cross: np.ndarray, innovation: np.ndarray) -> None:
        inverse = np.linalg.inv(np.linalg.cholesky(S))
        whitened = (inverse @ innovation[..., None])[..., 0]
        gain = cross @ inverse.transpose(0, 2, 1)  # K L
        self.nu = whitened.T
        self.P = self.P - gain @ gain.transpose(0, 2, 1)
        self._shift((gain @ whitened[..., None])[..., 0].T)

    def _shift(self, by: np.ndarray) -> None:
        self.x = self.x + by

    def now(self, u: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(tilt, ball rates, heading) dt after the filter's own instant."""
        motion = self.model.ahead(self.x[:10], u + self.x[15:18], dt)
        return motion[:2], motion[PHI], self.heading_rad + 0.5 * dt * (self.x[TURN] + motion[TURN])


class Unscented(Extended):
    """Sigma points through process and measurement in place of Jacobians (Julier and Uhlmann; van der Merwe's
    weights). Points of the wheel scale move the sum about z alone, as F and H of the firmware have it."""

    name: ClassVar[str] = "unscented"
    alpha, beta, kappa = 1.0, 2.0, 0.0

    def __init__(self, model: Model, x: np.ndarray) -> None:
        super().__init__(model, x)
        spread = self.alpha**2 * (N + self.kappa)
        self.reach = np.sqrt(spread)
        self.mean_weight = np.full(2 * N + 1, 0.5 / spread)
        self.weight = self.mean_weight.copy()
        self.mean_weight[0] = 1.0 - N / spread
        self.weight[0] = self.mean_weight[0] + 1.0 - self.alpha**2 + self.beta

    def _points(self) -> np.ndarray:
        """(states, points, runs)"""
        away = self.reach * np.linalg.cholesky(self.P).transpose(1, 2, 0)
        x = self.x[:, None]
        return np.concatenate([x, x + away, x - away], axis=1)

    def _spread(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean, and departures from it as (runs, states, points)."""
        mean = points[:, 0] + np.tensordot(points - points[:, :1], self.mean_weight, ((1,), (0,)))
        return mean, (points - mean[:, None]).transpose(2, 0, 1)

    def _propagate(self, u: np.ndarray) -> None:
        points = self.model.step(self._points(), u[:, None], self.x[SCALE])
        self.x, away = self._spread(points)
        self.P = (away * self.weight) @ away.transpose(0, 2, 1) + self.model.Q

    def update(self, u: np.ndarray, y: np.ndarray, use: np.ndarray) -> None:
        points = self._points()
        mean, seen = self._spread(self.model.measure(points, u[:, None], self.x[SCALE]))
        seen = seen * use.T[..., None]
        weighted = (seen * self.weight).transpose(0, 2, 1)
        away = (points - self.x[:, None]).transpose(2, 0, 1)
        self._correct(seen @ weighted + self.model.R, away @ weighted, (use * (y - mean)).T)


def body_rates(tilt: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """[T] (A.13)"""
    (sx, sy), (cx, cy) = np.sin(tilt), np.cos(tilt)
    dtx, dty, dtz = rates
    return np.stack([dtx - sy * dtz, cx * dty + cy * sx * dtz, -sx * dty + cx * cy * dtz])


def euler_rates(tilt: np.ndarray, omega_B: np.ndarray) -> np.ndarray:
    (sx, sy), (cx, cy) = np.sin(tilt), np.cos(tilt)
    z = (sx * omega_B[1] + cx * omega_B[2]) / cy
    return np.stack([omega_B[0] + sy * z, cx * omega_B[1] - sx * omega_B[2], z])


def rotation(tilt: np.ndarray) -> np.ndarray:
    """Yaw frame <- body, (runs, 3, 3)."""
    (sx, sy), (cx, cy) = np.sin(tilt), np.cos(tilt)
    zero = np.zeros_like(sx)
    rows = [[cy, sy * sx, sy * cx], [zero, cx, -sx], [-sy, cy * sx, cy * cx]]
    return np.array(rows).transpose(2, 0, 1)


def exponential(turn: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors (3, runs)."""
    angle = np.maximum(np.linalg.norm(turn, axis=0), 1e-12)
    x, y, z = turn
    zero = np.zeros_like(x)
    K = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    sine, cosine = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
    return np.eye(3) + sine[:, None, None] * K + cosine[:, None, None] * (K @ K)


class WithHeading(Extended):
    """Heading as one more state, which follows the innovations through its covariance: a control for the next
    filter, which has to have it."""

    name: ClassVar[str] = "extended, heading a state"
    errors: ClassVar[int] = N + 1  # heading last

    def _propagate(self, u: np.ndarray) -> None:
        back = self._from_errors()
        self.x, F_states = self.model.predict(self.x, u)
        F = np.zeros_like(self.P)
        F[:, :N, :N] = F_states
        F[:, N, :N] = 0.5 * DT * F_states[:, TURN]
        F[:, N, TURN] += 0.5 * DT
        F[:, N, N] = 1.0
        there = self._to_errors()
        F = there @ F @ back
        Q = there[:, :, :N] @ self.model.Q @ there[:, :, :N].transpose(0, 2, 1)
        self.P = F @ self.P @ F.transpose(0, 2, 1) + Q

    def _H(self, u: np.ndarray) -> np.ndarray:
        return self.model.measure_jacobian(self.x, u) @ self._from_errors()[:, :N]

    def _to_errors(self) -> np.ndarray:
        """d(errors)/d(states and heading) at x."""
        return np.tile(np.eye(self.errors), (self.x.shape[1], 1, 1))

    def _from_errors(self) -> np.ndarray:
        return self._to_errors()

    def _shift(self, by: np.ndarray) -> None:
        self.x = self.x + by[:N]
        self.heading_rad = self.heading_rad + by[N]


class ErrorState(WithHeading):
    """The attitude's error is a rotation, right-invariant: R = Exp(xi) R_hat, xi resolved in the yaw frame;
    the rates' error is one of body rates. The other errors are differences, as before; the noise is the same,
    brought into these coordinates."""

    name: ClassVar[str] = "error-state"
    PLACES: ClassVar[list[int]] = [0, 1, N, 5, 6, 7]  # angles, rates

    def __init__(self, model: Model, x: np.ndarray) -> None:
        super().__init__(model, x)
        there = self._to_errors()
        self.P = there @ self.P @ there.transpose(0, 2, 1)

    def _chart(self) -> np.ndarray:
        """d(xi, body rates)/d(angles, Euler rates) at x: (runs, 6, 6)."""
        tilt, (_, dty, dtz) = self.x[:2], self.x[RATES]
        (sx, sy), (cx, cy) = np.sin(tilt), np.cos(tilt)
        T = np.zeros((self.x.shape[1], 6, 6))
        T[:, 0, 0], T[:, 2, 0], T[:, 1, 1], T[:, 2, 2] = cy, -sy, 1.0, 1.0
        T[:, 3, 1] = -cy * dtz
        T[:, 4, 0], T[:, 4, 1] = -sx * dty + cy * cx * dtz, -sy * sx * dtz
        T[:, 5, 0], T[:, 5, 1] = -cx * dty - sx * cy * dtz, -cx * sy * dtz
        T[:, 3, 3], T[:, 3, 5] = 1.0, -sy
        T[:, 4, 4], T[:, 4, 5] = cx, cy * sx
        T[:, 5, 4], T[:, 5, 5] = -sx, cx * cy
        return T

    def _placed(self, T: np.ndarray) -> np.ndarray:
        whole = super()._to_errors()
        whole[:, np.array(self.PLACES)[:, None], self.PLACES] = T
        return whole

    def _to_errors(self) -> np.ndarray:
        return self._placed(self._chart())

    def _from_errors(self) -> np.ndarray:
        return self._placed(np.linalg.inv(self._chart()))

    def _shift(self, by: np.ndarray) -> None:
        omega_B = body_rates(self.x[:2], self.x[RATES]) + by[RATES]
        R = exponential(by[[0, 1, N]]) @ rotation(self.x[:2])
        x = self.x + by[:N]
        x[0] = np.arctan2(R[:, 2, 1], R[:, 2, 2])
        x[1] = -np.arcsin(R[:, 2, 0])
        x[RATES] = euler_rates(x[:2], omega_B)
        self.x = x
        self.heading_rad = self.heading_rad + np.arctan2(R[:, 1, 0], R[:, 0, 0])


class WithTorques(Extended):
    """F's columns of the disturbance where the robot is, in place of upright at rest, and what the yaw rate
    does to the disturbance's direction: a control for the sigma points, which see both."""

    name: ClassVar[str] = "extended, whole F"

    def _propagate(self, u: np.ndarray) -> None:
        B = self.model.input_jacobian(self.x, u)
        self.x, F = self.model.predict(self.x, u)
        F[:, :MOTION, U] = B
        F[:, U.start, TURN], F[:, U.start + 1, TURN] = DT * self.x[16], -DT * self.x[15]
        self.P = F @ self.P @ F.transpose(0, 2, 1) + self.model.Q


FILTERS = (Extended, Unscented, ErrorState, WithHeading)
