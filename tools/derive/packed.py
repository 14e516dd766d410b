"""Steps of a Kalman filter as straight-line code: the covariance as a packed upper triangle, Heun's rule, the
scalar updates. No matrix product is formed."""

from __future__ import annotations

from .straight import Emitter, Value, dot, inner, is_pair, nonzero, pair, total


class Covariance:
    """A symmetric n x n matrix, n even, whose upper triangle lies packed by rows in an array.

    Rows start at an even column, so that pairs are aligned: an odd row has an unused entry in front.
    """

    def __init__(self, emitter: Emitter, array: str, n: int):
        self.emitter, self.n, self.array = emitter, n, array
        self.version, self.changed = 0, {}

    def place(self, i: int, j: int) -> str:
        i, j = min(i, j), max(i, j)
        before = i * self.n - 2 * (i // 2) * ((i - 1) // 2)  # entries of the rows above
        return f"{self.array}[{before + j - i // 2 * 2 - self.middle(self.n)}]"

    @staticmethod
    def size(n: int) -> int:
        return n * (n + 2) // 2

    @staticmethod
    def middle(n: int) -> int:
        """The entry that the array's pointer points to: VFP's loads reach 1020 bytes, both ways."""
        return Covariance.size(n) // 4 * 2

    def __getitem__(self, ij):
        ij = min(ij), max(ij)
        return self.changed.get(ij) or self.emitter.load(self.place(*ij), self.version, pair=False)

    def __setitem__(self, ij, value):
        self.changed[min(ij), max(ij)] = value

    def pair(self, k: int, q: int) -> Value:
        """Columns 2 q and 2 q + 1 of row k."""
        if k <= 2 * q and not {(k, 2 * q), (k, 2 * q + 1)} & self.changed.keys():
            return self.emitter.load(self.place(k, 2 * q), self.version)
        return pair(self[k, 2 * q], self[k, 2 * q + 1])

    def transform(self, rows: dict[int, dict]) -> None:
        """P = T P T' with T the identity but for `rows` (sparse, diagonal entry included)."""
        half = {i: {} for i in rows}
        for q in range(self.n // 2):
            columns = {k: self.pair(k, q) for row in rows.values() for k in nonzero(row)}
            for i, row in rows.items():
                both = dot(row, columns.__getitem__)
                half[i][2 * q], half[i][2 * q + 1] = both[0], both[1]
        for i in rows:
            for j in range(self.n):
                if j not in rows:
                    self[i, j] = half[i][j]
                elif i <= j:
                    self[i, j] = inner(rows[j], half[i].__getitem__)

    def store(self) -> None:
        """What changed; neighbours that are a pair in one go. From then on it is loaded again."""
        places = sorted(self.changed)
        while places:
            i, j = places.pop(0)
            value = self.changed[i, j]
            if j % 2 == 0 and places[:1] == [(i, j + 1)] and is_pair(value, self.changed[i, j + 1]):
                value = pair(value, self.changed[places.pop(0)])
            self.emitter.store(self.place(i, j), value)
        self.changed.clear()
        self.emitter.settle()
        self.version += 1


def heun(x: list[Value], derivative, dt: float):
    """(x after dt, its Jacobian as sparse rows) by Heun's third-order rule, as in estimate/heun.hpp.

    derivative(x, scale) -> (scale x_dot, scale A as a sparse dict): a scale within costs nothing.
    """
    first, A_first = derivative(x, dt / 3.0)
    second, A_second = derivative([a + b for a, b in zip(x, first, strict=True)], 2.0 * dt / 3.0)
    third, A_third = derivative([a + b for a, b in zip(x, second, strict=True)], 0.75 * dt)
    after = [a + (0.75 * b + c) for a, b, c in zip(x, first, third, strict=True)]
    one, part = (x[0].emitter.constant(c) for c in (1.0, 0.75))
    A_first, A_second, A_third = (_rows(A) for A in (A_first, A_second, A_third))
    slope = _sum((one, A_second), (one, _times(A_second, A_first)))
    identity = {i: {i: one} for i in range(len(x))}
    return after, _sum((one, identity), (part, A_first), (one, A_third), (one, _times(A_third, slope)))


def heun_state(x: list[Value], derivative, dt: Value) -> list[Value]:
    """x after dt alone, dt as it comes; what only the Jacobian needs is not emitted."""
    third = dt * (1.0 / 3.0)
    first, _ = derivative(x, 1.0)
    second, _ = derivative([a + third * b for a, b in zip(x, first, strict=True)], 1.0)
    slope, _ = derivative([a + (third + third) * b for a, b in zip(x, second, strict=True)], 1.0)
    return [a + dt * 0.25 * (b + 3.0 * c) for a, b, c in zip(x, first, slope, strict=True)]


def by_pairs(terms: list[tuple[Value, dict]]) -> dict:
    """The sum of factor times sparse row; neighbours that both have an entry are computed at once."""
    result: dict = {}
    terms = [(c, nonzero(row)) for c, row in terms if c.number != 0.0]
    columns = {j for _, row in terms for j in row}
    for even in sorted({j - j % 2 for j in columns}):
        odd = even + 1
        if not {even, odd} <= columns:
            j = even if even in columns else odd
            result[j] = total(c * row[j] for c, row in terms if j in row)
            continue
        both = []
        for c, row in terms:
            zero = c.emitter.constant(0.0)
            if even in row and odd in row:
                both.append(c * pair(row[even], row[odd]))
            elif even in row:
                both.append(pair(c * row[even], zero))
            elif odd in row:
                both.append(pair(zero, c * row[odd]))
        whole = total(both)
        result[even], result[odd] = whole[0], whole[1]
    return result


def _rows(A: dict) -> dict:
    rows: dict = {}
    for (i, j), v in A.items():
        rows.setdefault(i, {})[j] = v
    return rows


def _times(A: dict, B: dict) -> dict:
    """Rows of A B; a row that B does not have is zero."""
    return {i: by_pairs([(a, B[k]) for k, a in row.items() if k in B]) for i, row in A.items()}


def _sum(*summands: tuple[Value, dict]) -> dict:
    """Of rows, each times a factor."""
    rows = {i for _, A in summands for i in A}
    return {i: by_pairs([(c, A[i]) for c, A in summands if i in A]) for i in sorted(rows)}


class Projected:
    """P h of every row, in memory by pairs of states: what a row's updates leave is loaded again for the
    next, so that little has to lie on the stack."""

    def __init__(self, emitter: Emitter, array: str, n: int, m: int):
        self.emitter, self.array, self.n, self.m = emitter, array, n, m
        self.version = 0

    def place(self, q: int, i: int) -> str:
        """States 2 q and 2 q + 1 of row i."""
        return f"{self.array}[{2 * (q * self.m + i) - self.middle(self.n, self.m)}]"

    @staticmethod
    def middle(n: int, m: int) -> int:
        return n * m // 4 * 2

    def __getitem__(self, qi: tuple[int, int]) -> Value:
        return self.emitter.load(self.place(*qi), self.version)

    def __setitem__(self, qi: tuple[int, int], value: Value):
        self.emitter.store(self.place(*qi), value)

    def settle(self) -> None:
        self.emitter.settle()
        self.version += 1

    def entry(self, i: int):
        """Of row i, by state."""
        return lambda k: self[k // 2, i][k % 2]


def innovate(
    emitter: Emitter, P: Covariance, rows: list[dict], residuals: list[Value], sums: dict, precise: dict
) -> None:
    """All measurements, one after the other; the correction is left to the caller: x += step Ph, P -= weight
    Ph Ph'.

    `sums`: sums of states, by name, that several rows use. A row whose flag is clear has no weight; its
    innovation and variance are stored all the same. `precise`: for restore().
    """
    n, m, one = P.n, len(rows), emitter.constant(1.0)
    Ph = Projected(emitter, "Ph", n, m)

    def measured(row, vector):
        return dot(row, lambda s: dot(sums.get(s, {s: one}), vector))

    def covered(row, vector):
        flat: dict = {}
        for s, c in row.items():
            for k, v in sums.get(s, {s: one}).items():
                flat[k] = flat[k] + c * v if k in flat else c * v
        return inner(flat, vector)

    for q in range(n // 2):
        columns = {}
        for i, row in enumerate(rows):
            Ph[q, i] = measured(row, lambda k, q=q, known=columns: known.setdefault(k, P.pair(k, q)))
    weights, innovations, all_shares = [], [], []
    for i, row in enumerate(rows):
        Ph.settle()
        # With the rows before it, and its own.
        covariances = [covered(row, Ph.entry(j)) for j in range(i + 1)]
        shares = [c * w for c, w in zip(covariances, weights, strict=False)]
        all_shares.append(shares)
        variance = covariances[i] + emitter.variable(f"R[{i}]")
        innovation = residuals[i]
        for share, c, seen in zip(shares, covariances, innovations, strict=False):
            variance = variance - share * c
            innovation = innovation - share * seen
        for q in range(n // 2) if shares else ():
            both = Ph[q, i]
            for j, share in enumerate(shares):
                both = both - share * Ph[q, j]
            Ph[q, i] = both
        emitter.store(f"row_innovation[{i}]", innovation)
        emitter.store(f"row_variance[{i}]", variance)
        weights.append(emitter.select(f"use[{i}]", variance.inverse()))
        innovations.append(emitter.select(f"use[{i}]", innovation))
        step = weights[i] * innovations[i]
        emitter.store(f"weight[{i}]", weights[i])
        emitter.store(f"step[{i}]", step)
        emitter.store(f"row_nis[{i}]", step * innovations[i])
    place = 0
    for i, (_, columns) in precise.items():
        for k in sorted(columns):
            emitter.store(f"h[{place}]", rows[i].pop(k))
            place += 1
        if rows[i]:
            raise ValueError(f"row {i} has more columns: {rows[i]}")
    for place, i in enumerate(precise):
        part = {i: one}  # of the row's innovation in that of each later row
        for j in range(i + 1, m):
            part[j] = -total(all_shares[j][k] * part[k] for k in range(i, j))
        for j in range(i, m):
            emitter.store(f"gain[{place * m + j}]", emitter.variable(f"R[{i}]") * weights[j] * part[j])


def restore(emitter: Emitter, P: Covariance, precise: dict[int, tuple[int, list[int]]]) -> None:
    """Digits of P that innovate()'s correction has lost: of a state that a row all but measures by itself, P
    falls by decades in every tick, as the difference of numbers that are nearly equal.

    `precise`: row -> that state, and the row's columns. Once all rows are in, P h = R K (`exact`), K the
    row's column of the gain, where nothing cancels; without the other columns' part it is the state's row.
    """
    n, one = P.n, emitter.constant(1.0)
    place = 0
    for order, (state, columns) in enumerate(precise.values()):
        h = {k: emitter.variable(f"h[{place + i}]") for i, k in enumerate(sorted(columns))}
        place += len(columns)
        flag, scale = emitter.select(f"use[{order}]", one), h[state].inverse()

        def restored(exact, entry, old, h=h, state=state, flag=flag, scale=scale):
            for k in sorted(h.keys() - {state}):
                exact = exact - h[k] * entry(k)
            return old + flag * (exact * scale - old)

        new: dict[int, Value] = {}
        for q in range(n // 2):
            exact = emitter.load(f"exact[{order * n + 2 * q}]")
            both = restored(exact, lambda k, q=q: P.pair(k, q), P.pair(state, q))
            new[2 * q], new[2 * q + 1] = both[0], both[1]
        old = P[state, state]
        for j in range(n):
            if j != state:
                P[state, j] = new[j]
        exact = emitter.load(f"exact[{order * n + state}]", pair=False)
        P[state, state] = restored(exact, lambda k, state=state: P[k, state], old)
        P.store()
