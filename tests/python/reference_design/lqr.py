"""Sampled linear design: zero-order hold, LQR, and the margins of a single loop, real or complex.

A spinning symmetric robot is a complex system: a loop gain may then rotate, and its Nyquist curve is not
symmetric, so both signs of frequency are looked at.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg


def sampled(A, b, dt: float):
    """Zero-order hold."""
    n, m = len(A), b.shape[1]
    block = linalg.expm(np.block([[A, b], [np.zeros((m, n + m))]]) * dt)
    return block[:n, :n], block[:n, n:]


def lqr(A, b, state_weights, input_weights):
    """K of u = -K x that minimises sum x^H Q x + u^H R u."""
    Q, R = np.diag(np.asarray(state_weights, A.dtype)), np.diag(np.asarray(input_weights, A.dtype))
    P = linalg.solve_discrete_are(A, b, Q, R)
    return np.linalg.solve(R + b.conj().T @ P @ b, b.conj().T @ P @ A)


def delayed(A, b, K, ticks: int):
    """The same loop with the input `ticks` late."""
    for _ in range(ticks):
        n = len(A)
        A = np.block([[A, b], [np.zeros((1, n + 1))]])
        b = np.vstack([np.zeros((n, 1)), [[1]]])
        K = np.hstack([K, [[0]]])
    return A, b, K


def largest_pole(A, b, K) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(A - b @ K))))


@dataclass(frozen=True)
class Margins:
    """Of the loop broken at the input. Infinite where nothing in range destabilises."""

    pole: float  # largest closed-loop magnitude
    gain_up_dB: float
    gain_down_dB: float  # negative: by how much the gain may fall
    phase_deg: float  # smallest rotation, either way
    delay_ticks: float
    pole_one_tick_late: float

    def __str__(self) -> str:
        return (
            f"pole {self.pole:.4f}  gain {self.gain_down_dB:+6.1f} / {self.gain_up_dB:+5.1f} dB  "
            f"phase {self.phase_deg:4.1f} deg  delay {self.delay_ticks:4.1f} ticks  "
            f"one tick late {self.pole_one_tick_late:.4f}"
        )


def margins(A, b, K) -> Margins:
    pole = largest_pole(A, b, K)
    late = largest_pole(*delayed(A, b, K, 1))
    if pole >= 1:
        return Margins(pole, 0.0, 0.0, 0.0, 0.0, late)
    crossings = list(_crossings(A, b, K))
    return Margins(
        pole=pole,
        gain_up_dB=_gain_margin(A, b, K, 1),
        gain_down_dB=-_gain_margin(A, b, K, -1),
        phase_deg=np.degrees(min((abs(np.angle(-L)) for _, L in crossings), default=np.inf)),
        # A delay of d ticks turns L(w) by -w d: forward in time only, whatever the sign of w.
        delay_ticks=min(
            ((np.sign(w) * np.angle(-L)) % (2 * np.pi) / abs(w) for w, L in crossings), default=np.inf
        ),
        pole_one_tick_late=late,
    )


def _gain_margin(A, b, K, sign: int, limit_dB: float = 60.0) -> float:
    """First loss of stability on the way up (sign 1) or down (-1), bisected."""

    def unstable(dB):
        return largest_pole(A, b, 10 ** (sign * dB / 20) * K) >= 1

    steps = np.arange(0.25, limit_dB, 0.25)
    high = next((s for s in steps if unstable(s)), None)
    if high is None:
        return np.inf
    low = high - 0.25
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(middle) else (middle, high)
    return float(low)


def _crossings(A, b, K, points: int = 2000):
    """(frequency in rad per tick, L) where |L| = 1."""
    values, vectors = np.linalg.eig(A)
    left = K @ vectors
    right = np.linalg.solve(vectors, b)

    def L(w):
        return complex(np.sum(left[0] * right[:, 0] / (np.exp(1j * w) - values)))

    positive = np.logspace(-3, np.log10(np.pi), points)
    for grid in (positive, -positive):
        size = [abs(L(w)) - 1 for w in grid]
        for i in np.flatnonzero(np.diff(np.sign(size))):
            low, high = grid[i], grid[i + 1]
            for _ in range(30):
                middle = (low + high) / 2
                low, high = (
                    (middle, high) if np.sign(abs(L(middle)) - 1) == np.sign(size[i]) else (low, middle)
                )
            yield high, L(high)
