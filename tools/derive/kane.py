"""Kane's equations for any set of speeds, and truncation to first order in chosen small quantities."""

from __future__ import annotations

import sympy as sp


def total_derivative(expression, rates: dict):
    """d/dt of a function of coordinates and speeds; `rates` maps each to its time derivative."""
    return sum((sp.diff(expression, q) * rate for q, rate in rates.items()), sp.Integer(0))


class Kane:
    """Sums (partial velocity)^T (force - inertia force) over the bodies.

    speeds: the independent speeds u; accelerations: symbols for their time derivatives;
    rates: time derivative of every coordinate and speed that the velocities contain.
    """

    def __init__(self, speeds, accelerations, rates: dict):
        self.speeds = sp.Matrix(speeds)
        self.accelerations = sp.Matrix(accelerations)
        self.rates = rates
        self._inertia = sp.zeros(len(speeds), 1)
        self._force = sp.zeros(len(speeds), 1)

    def derivative(self, vector, frame_rate=None):
        """Time derivative; with frame_rate, of a vector given in axes that turn at frame_rate (same axes)."""
        result = sp.Matrix(vector).applyfunc(lambda e: total_derivative(e, self.rates))
        return result if frame_rate is None else result + frame_rate.cross(sp.Matrix(vector))

    def inertia(self, velocity, momentum, frame_rate=None):
        """Adds a body whose generalised momentum along `velocity` is `momentum`."""
        self._inertia += velocity.jacobian(self.speeds).T * self.derivative(momentum, frame_rate)

    def force(self, velocity, force):
        """Adds a force (torque) that works along `velocity` (angular velocity)."""
        self._force += velocity.jacobian(self.speeds).T * force

    def equations(self):
        """(mass matrix, right-hand side) of mass * accelerations = rhs."""
        mass = self._inertia.jacobian(self.accelerations)
        rest = self._inertia.subs(dict.fromkeys(self.accelerations, 0))
        return mass, self._force - rest


def first_order(expression, small):
    """Taylor polynomial of degree one in `small`, about zero."""
    zero = dict.fromkeys(small, 0)
    return expression.subs(zero) + sum((sp.diff(expression, s).subs(zero) * s for s in small), sp.Integer(0))


def solve_first_order(mass, rhs, small, parameters=lambda e: e):
    """Accelerations to first order in `small`: (M0 + M1) q = b0 + b1.

    `parameters` rewrites M and b in lumped parameters before the inversion, which keeps the result short.
    """

    def linear(e):
        return sp.expand(parameters(first_order(e, small)))

    mass, rhs = mass.applyfunc(linear), rhs.applyfunc(linear)
    zero = dict.fromkeys(small, 0)
    mass_0, rhs_0 = mass.subs(zero), rhs.subs(zero)
    inverse = mass_0.inv().applyfunc(sp.cancel)
    at_zero = inverse * rhs_0
    return at_zero + inverse * ((rhs - rhs_0) - (mass - mass_0) * at_zero)
