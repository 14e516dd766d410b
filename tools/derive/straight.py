"""Straight-line code for a Kalman filter: value-numbered emission and a covariance as a packed upper triangle.

`Emitter` folds constants, drops zeros, shares equal products; `Value` overloads the arithmetic. `Covariance` applies
F P F' in place as a sequence of row operations (F is factored, no matrix product is formed) and measurements one
scalar at a time, with a mask instead of a branch.
"""

from __future__ import annotations

import sympy as sp

from . import emit


class Emitter:
    def __init__(self):
        self.statements: list[str] = []
        self.known: dict = {}
        self.flops = 0

    def variable(self, text: str) -> Value:
        return Value(self, ("v", text))

    def constant(self, number: float) -> Value:
        return Value(self, ("c", float(number)))

    def name(self, key, text: str) -> Value:
        """The value of `text`, computed once."""
        if key not in self.known:
            name = f"t{len(self.known)}"
            self.statements.append(f"const double {name} = {text};")
            self.flops += 1
            self.known[key] = Value(self, ("v", name))
        return self.known[key]

    def call(self, function: str, value: Value) -> Value:
        return self.name((function, value.key), f"{function}({value})")

    def select(self, flag: str, value: Value) -> Value:
        return self.name(("?", flag, value.key), f"{flag} ? {value} : 0.0")

    def store(self, target: str, value: Value) -> None:
        self.statements.append(f"{target} = {value};")

    def lines(self) -> list[str]:
        return [line for s in self.statements for line in emit.statement(s)]

    def of(self, expression, values: dict) -> Value:
        """A SymPy expression of symbols in `values`; symbols named c.* are taken as they are."""
        e = sp.sympify(expression)
        if e.is_Symbol:
            return values[e] if e in values else self.variable(f"k.{e.name}")
        if e.is_Number:
            return self.constant(float(e))
        if e.is_Pow and e.exp.is_Integer and e.exp > 0:
            base = self.of(e.base, values)
            result = base
            for _ in range(int(e.exp) - 1):
                result = result * base
            return result
        parts = [self.of(a, values) for a in e.as_ordered_terms()] if e.is_Add else None
        if parts is None and e.is_Mul:
            parts = [self.of(a, values) for a in e.as_ordered_factors()]
            result = parts[0]
            for p in parts[1:]:
                result = result * p
            return result
        if parts is None:
            raise NotImplementedError(str(e))
        return total(parts)


class Value:
    """A constant, a variable, or one of them negated."""

    __slots__ = ("emitter", "key")

    def __init__(self, emitter: Emitter, key: tuple):
        self.emitter, self.key = emitter, key

    @property
    def number(self):
        return self.key[1] if self.key[0] == "c" else None

    def __str__(self):
        kind, body = self.key
        if kind == "c":
            return repr(body)
        return f"-{Value(self.emitter, body)}" if kind == "n" else body

    def _lift(self, other) -> Value:
        return other if isinstance(other, Value) else self.emitter.constant(other)

    def __neg__(self):
        kind, body = self.key
        if kind == "c":
            return self.emitter.constant(-body)
        return Value(self.emitter, body if kind == "n" else ("n", self.key))

    def __mul__(self, other):
        a, b = self, self._lift(other)
        if a.key[0] == "n":
            return -(Value(self.emitter, a.key[1]) * b)
        if b.key[0] == "n":
            return -(a * Value(self.emitter, b.key[1]))
        if a.number is not None and b.number is not None:
            return self.emitter.constant(a.number * b.number)
        if b.number is not None:
            a, b = b, a
        if a.number is not None:
            if a.number in (0.0, 1.0, -1.0):
                return {0.0: a, 1.0: b, -1.0: -b}[a.number]
            if a.number < 0.0:
                return -(self.emitter.constant(-a.number) * b)
        key = ("*", *sorted((a.key, b.key), key=str))
        return self.emitter.name(key, f"{a} * {b}")

    __rmul__ = __mul__

    def __add__(self, other):
        a, b = self, self._lift(other)
        if a.number == 0.0:
            return b
        if b.number == 0.0:
            return a
        if a.number is not None and b.number is not None:
            return self.emitter.constant(a.number + b.number)
        if a.key[0] == "n" and b.key[0] == "n":
            return -((-a) + (-b))
        if a.key[0] == "n":
            a, b = b, a
        if b.key[0] == "n":
            if a.key == b.key[1]:
                return self.emitter.constant(0.0)
            return self.emitter.name(("-", a.key, b.key[1]), f"{a} - {-b}")
        return self.emitter.name(("+", *sorted((a.key, b.key), key=str)), f"{a} + {b}")

    __radd__ = __add__

    def __sub__(self, other):
        return self + (-self._lift(other))

    def __rsub__(self, other):
        return (-self) + other

    def inverse(self):
        return self.emitter.name(("/", self.key), f"1.0 / {self if self.key[0] != 'n' else f'({self})'}")


def total(values) -> Value:
    values = list(values)
    result = values[0]
    for v in values[1:]:
        result = result + v
    return result


def nonzero(row: dict) -> dict:
    return {k: v for k, v in row.items() if v.number != 0.0}


class Covariance:
    """A symmetric n x n matrix whose upper triangle lies packed by rows in an array."""

    def __init__(self, emitter: Emitter, array: str, n: int):
        self.emitter, self.n = emitter, n
        self.array = array
        self.value = {
            (i, j): emitter.variable(f"{array}[{self.place(i, j)}]") for i in range(n) for j in range(i, n)
        }

    def place(self, i: int, j: int) -> int:
        i, j = min(i, j), max(i, j)
        return i * self.n - i * (i - 1) // 2 + j - i

    def __getitem__(self, ij):
        return self.value[min(ij), max(ij)]

    def __setitem__(self, ij, value):
        self.value[min(ij), max(ij)] = value

    def transform(self, rows: dict[int, dict]) -> None:
        """P = T P T' with T the identity but for `rows` (sparse, diagonal entry included)."""
        old = dict(self.value)

        def before(i, j):
            return old[min(i, j), max(i, j)]

        half = {
            i: {j: total(c * before(k, j) for k, c in nonzero(row).items()) for j in range(self.n)}
            for i, row in rows.items()
        }
        for i, row in rows.items():
            for j in range(self.n):
                if j not in rows:
                    self[i, j] = half[i][j]
                elif i <= j:
                    self[i, j] = total(c * half[i][k] for k, c in nonzero(rows[j]).items())

    def propagate(self, F: dict, block: range) -> None:
        """P = F P F', F on `block` alone, factored into a unit lower and an upper triangle; no pivots: F is near 1."""
        U = {(i, j): F[i, j] for i in block for j in block}
        L = {}
        for k in block[:-1]:
            inverse = U[k, k].inverse()
            for i in range(k + 1, block.stop):
                L[i, k] = U[i, k] * inverse
                for j in range(k + 1, block.stop):
                    U[i, j] = U[i, j] - L[i, k] * U[k, j]
        for i in block:
            self.transform({i: {j: U[i, j] for j in range(i, block.stop)}})
        one = self.emitter.constant(1.0)
        for i in reversed(block):
            row = {k: L[i, k] for k in range(block.start, i)}
            if nonzero(row):
                self.transform({i: {**row, i: one}})

    def observe(self, row: dict, variance: Value, flag: str):
        """One scalar measurement: (gain, 1 / innovation variance), both zero where the flag is clear."""
        row = nonzero(row)
        Ph = [total(c * self[j, k] for j, c in row.items()) for k in range(self.n)]
        s = total(c * Ph[j] for j, c in row.items()) + variance
        weight = self.emitter.select(flag, s.inverse())
        gain = [p * weight for p in Ph]
        for i in range(self.n):
            for j in range(i, self.n):
                self[i, j] = self[i, j] - gain[i] * Ph[j]
        return gain, weight

    def store(self) -> None:
        for i in range(self.n):
            for j in range(i, self.n):
                target = f"{self.array}[{self.place(i, j)}]"
                if str(self[i, j]) != target:
                    self.emitter.store(target, self[i, j])


def correct(emitter: Emitter, P: Covariance, rows: list[dict], residuals: list[Value]) -> list[Value]:
    """All measurements, one after the other: the correction of the state. Stores every row's squared innovation."""
    correction = [emitter.constant(0.0)] * P.n
    for i, (row, residual) in enumerate(zip(rows, residuals, strict=True)):
        gain, weight = P.observe(row, emitter.variable(f"k.R[{i}]"), f"use[{i}]")
        left = residual - total(c * correction[j] for j, c in nonzero(row).items())
        left = emitter.select(f"use[{i}]", left)
        emitter.store(f"row_nis[{i}]", left * left * weight)
        correction = [x + g * left for x, g in zip(correction, gain, strict=True)]
    return correction


def midpoint(x: list[Value], derivative, dt: float):
    """(x after dt, its Jacobian as a sparse dict without the identity); derivative(x) -> (x_dot, {(i, j): A})."""
    x_dot, first = derivative(x)
    middle = [a + (0.5 * dt) * b for a, b in zip(x, x_dot, strict=True)]
    x_dot, second = derivative(middle)
    after = [a + dt * b for a, b in zip(x, x_dot, strict=True)]
    n = len(x)
    jacobian = {}
    for i in range(n):
        steps = {k: v for (r, k), v in second.items() if r == i and v.number != 0.0}
        for j in range(n):
            terms = [0.5 * dt * (v * first[k, j]) for k, v in steps.items() if (k, j) in first]
            if j in steps:
                terms.append(steps[j])
            if terms:
                jacobian[i, j] = dt * total(terms)
    return after, jacobian
