"""Straight-line code: value-numbered emission.

`Emitter` folds constants, drops zeros, computes equal expressions once, and moves what depends on the
filter's constants alone to a function that runs at the start, in double. Values are scalars or pairs, two
neighbouring entries of a vector, which SSE2 and NEON compute at once; late code names their types One and Two
(estimate/lanes.hpp). Matrices are sparse dicts: what is zero in them costs nothing.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

import sympy as sp

from . import emit

NAME = re.compile(r"\bt\d+\b")
DEFINITION = re.compile(r"const (?:double|Pair|One|Two) (t\d+) =")
REGISTER = re.compile(r"(?:low|high)?\(?t\d+\)?")


@dataclass(frozen=True)
class Lines:
    """Code that runs at the start, code that runs later, and how many values, alone and in pairs, are kept
    between; without what nothing needs."""

    early: list[str]
    late: list[str]
    values: int
    pairs: int


class Emitter:
    def __init__(self, constants: str):
        self.constants = constants  # array of the values that are computed at the start
        self.statements: list[str] = []
        self.early: list[str] = []
        self.known: dict = {}
        self.kept: dict[str, str] = {}  # early name -> its place in the array

    def variable(self, text: str, early: bool = False) -> Value:
        return Value(self, ("v", text), early=early)

    def constant(self, number: float) -> Value:
        return Value(self, ("c", float(number)), early=True)

    def load(self, first: str, version: int = 0, pair: bool = True) -> Value:
        """Two neighbours in memory, or one; `version` grows with every settle() after which they are loaded
        again."""
        text = f"load(&{first})" if pair else f"One({first})"
        return self.name(("load", first, version, pair), text, pair=pair)

    def settle(self) -> None:
        self.statements.append("settle();")

    def name(self, key, text: str, early: bool = False, pair: bool = False) -> Value:
        """The value of `text`, computed once."""
        if key not in self.known:
            name = f"t{len(self.known)}"
            type_name = (("double", "Pair") if early else ("One", "Two"))[pair]
            (self.early if early else self.statements).append(f"const {type_name} {name} = {text};")
            self.known[key] = Value(self, ("v", name), pair, early)
        return self.known[key]

    def use(self, value: Value, early: bool = False) -> str:
        """How code, early or late, calls a value."""
        kind, body = value.key
        if kind == "n":
            return f"-{self.use(Value(self, body, value.pair, value.early), early)}"
        if kind == "c":
            return repr(body) if early else f"One({body!r})"
        if early:
            return body
        if not value.early or not NAME.fullmatch(body):
            return body if REGISTER.fullmatch(body) else f"One({body})"
        if body not in self.kept:
            self.kept[body] = f"{self.constants}{'_pairs' if value.pair else ''}[{len(self.kept)}]"
        return f"load(&{self.kept[body]})" if value.pair else f"One({self.kept[body]})"

    def select(self, flag: str, value: Value) -> Value:
        return self.name(("?", flag, value.key), f"select({flag}, {self.use(value)})")

    def store(self, target: str, value: Value) -> None:
        text = self.use(value)
        if text != f"One({target})":
            self.statements.append(f"store(&{target}, {text});")

    def lines(self) -> Lines:
        late = _joined(_needed(self.statements))
        place = re.compile(re.escape(self.constants) + r"(?:_pairs)?\[\d+\]")
        used = dict.fromkeys(found for s in late for found in place.findall(s))
        new, count = {}, {}
        for old in used:
            array = old.partition("[")[0]
            new[old] = f"{array}[{count.get(array, 0)}]"
            count[array] = count.get(array, 0) + (2 if array.endswith("_pairs") else 1)
        kept = [
            f"store(&{new[old]}, {name});" if "_pairs" in old else f"{new[old]} = {name};"
            for name, old in self.kept.items()
            if old in new
        ]
        late = [place.sub(lambda old: new[old[0]], s) for s in late]
        counts = (count.get(self.constants, 0), count.get(f"{self.constants}_pairs", 0))
        return Lines(_wrapped(_needed([*self.early, *kept])), _wrapped(late), *counts)

    def of(self, expression, values: dict) -> Value:
        """A SymPy polynomial of symbols in `values`; other symbols are members of the filter's constants."""
        e = sp.sympify(expression)
        if e.is_Symbol:
            return values[e] if e in values else self.variable(f"k.{e.name}", early=True)
        if e.is_Number:
            return self.constant(float(e))
        if e.is_Pow and e.exp.is_Integer and e.exp > 0:
            return product([self.of(e.base, values)] * int(e.exp))
        if e.is_Add:
            return total(self.of(a, values) for a in e.as_ordered_terms())
        if e.is_Mul:
            return product([self.of(a, values) for a in e.as_ordered_factors()])
        raise NotImplementedError(str(e))


def _needed(statements: list[str]) -> list[str]:
    needed, kept = set(), []
    for s in reversed(statements):
        target = DEFINITION.match(s)
        if target is None or target[1] in needed:
            needed |= set(NAME.findall(s.partition("=")[2] if target else s))
            kept.append(s)
    return kept[::-1]


PRODUCT = re.compile(r"const (?:One|Two) (t\d+) = (\S+) \* (\S+);")
SUM = re.compile(r"(const (?:One|Two) t\d+ =) (\S+) ([+-]) (\S+);")


def _joined(statements: list[str]) -> list[str]:
    """A product that one sum uses is written into it: NEON adds it as it multiplies."""
    uses = Counter(name for s in statements for name in NAME.findall(s.partition(" = ")[2] or s))
    products: dict[str, tuple[int, str]] = {}
    kept: list[str] = []
    for s in statements:
        product, added = PRODUCT.fullmatch(s), SUM.fullmatch(s)
        if product and uses[product[1]] == 1:
            products[product[1]] = (len(kept), f"{product[2]}, {product[3]}")
        if added:
            target, first, sign, second = added.groups()
            if sign == "+" and second not in products:
                first, second = second, first
            if second in products:
                place, factors = products.pop(second)
                kept[place] = ""
                s = f"{target} {'plus' if sign == '+' else 'minus'}({first}, {factors});"
        elif not s.startswith("const"):
            products.clear()  # what they read may change
        kept.append(s)
    return [s for s in kept if s]


def _wrapped(statements: list[str]) -> list[str]:
    """A name is given once; `const` would say so in 40 kB."""
    return [line for s in statements for line in emit.statement(s.removeprefix("const "))]


class Value:
    """A constant, a variable, or one of them negated; `early`: it never changes while the filter runs."""

    __slots__ = ("early", "emitter", "key", "pair")

    def __init__(self, emitter: Emitter, key: tuple, pair: bool = False, early: bool = False):
        self.emitter, self.key, self.pair, self.early = emitter, key, pair, early

    @property
    def number(self):
        return self.key[1] if self.key[0] == "c" else None

    @property
    def is_negated(self) -> bool:
        return self.key[0] == "n"

    def _lift(self, other) -> Value:
        return other if isinstance(other, Value) else self.emitter.constant(other)

    def __neg__(self):
        kind, body = self.key
        if kind == "c":
            return self.emitter.constant(-body)
        return Value(self.emitter, body if kind == "n" else ("n", self.key), self.pair, self.early)

    def _named(self, sign: str, other: Value) -> Value:
        a, b = self, other
        if a.pair is not b.pair:  # GCC would fill both lanes anew for every product
            early = a.early and b.early
            a, b = (v if v.pair else twice(v, early) for v in (a, b))
        early, pair = a.early and b.early, a.pair or b.pair
        if sign != "-" and (a.pair, str(a.key)) > (b.pair, str(b.key)):
            a, b = b, a
        text = f"{self.emitter.use(a, early)} {sign} {self.emitter.use(b, early)}"
        return self.emitter.name((sign, a.key, b.key), text, early, pair)

    def __mul__(self, other):
        a, b = self, self._lift(other)
        if a.is_negated:
            return -(-a * b)
        if b.is_negated:
            return -(a * -b)
        if a.number is not None and b.number is not None:
            return self.emitter.constant(a.number * b.number)
        if b.number is not None:
            a, b = b, a
        if a.number is not None:
            if a.number in (0.0, 1.0, -1.0):
                return {0.0: a, 1.0: b, -1.0: -b}[a.number]
            if a.number < 0.0:
                return -(self.emitter.constant(-a.number) * b)
        return a._named("*", b)

    __rmul__ = __mul__

    def __add__(self, other):
        a, b = self, self._lift(other)
        if a.number == 0.0:
            return b
        if b.number == 0.0:
            return a
        if a.number is not None and b.number is not None:
            return self.emitter.constant(a.number + b.number)
        if a.is_negated and b.is_negated:
            return -(-a + -b)
        if a.is_negated:
            a, b = b, a
        if b.is_negated:
            return self.emitter.constant(0.0) if a.key == (-b).key else a._named("-", -b)
        return a._named("+", b)

    __radd__ = __add__

    def __sub__(self, other):
        return self + (-self._lift(other))

    def __rsub__(self, other):
        return (-self) + other

    def inverse(self):
        if self.is_negated:
            return -((-self).inverse())
        return self.emitter.name(("/", self.key), f"inverse({self.emitter.use(self)})")

    def __getitem__(self, lane: int) -> Value:
        """One of a pair."""
        if not self.pair:
            return self  # zero
        if self.is_negated:
            return -((-self)[lane])
        if self.early:
            e = self.emitter
            return e.name(("lane", self.key, lane), f"{e.use(self, True)}[{lane}]", early=True)
        return Value(self.emitter, ("v", f"{('low', 'high')[lane]}({self.key[1]})"))


def total(values) -> Value:
    result, *rest = values
    for v in rest:
        result = result + v
    return result


def product(values) -> Value:
    """What never changes apart from what does, so that each is computed once."""
    values = list(values)
    parts = [[v for v in values if v.early is early] for early in (True, False)]
    result = values[0].emitter.constant(1.0)
    for part in parts:
        if part:
            whole = part[0]
            for v in part[1:]:
                whole = whole * v
            result = result * whole
    return result


LANE = re.compile(r"(low|high)\((t\d+)\)")


def pair(a: Value, b: Value) -> Value:
    """Both in one; the lanes of a pair are that pair."""
    if a.number == 0.0 and b.number == 0.0:
        return a
    e = a.emitter
    if is_pair(a, b):
        return Value(e, ("v", LANE.fullmatch(a.key[1])[2]), pair=True)
    if a.is_negated and b.is_negated:
        return -pair(-a, -b)
    early = a.early and b.early and (a.number is None or b.number is None)
    both = f"{{{e.use(a, early)}, {e.use(b, early)}}}"
    return e.name(("pair", a.key, b.key), both, early, pair=True)


def twice(a: Value, early: bool) -> Value:
    """In both lanes."""
    if a.is_negated:
        return -twice(-a, early)
    text = a.emitter.use(a, early)
    both = f"{{{text}, {text}}}" if early else f"twice({text})"
    return a.emitter.name(("pair", a.key, a.key, early), both, early, pair=True)


def nonzero(row: dict) -> dict:
    return {k: v for k, v in row.items() if v.number != 0.0}


def dot(row: dict, vector) -> Value:
    """`vector(k)`: its entry k."""
    return total(c * vector(k) for k, c in nonzero(row).items())


def is_pair(a: Value, b: Value) -> bool:
    """The lanes of one."""
    lanes = [LANE.fullmatch(str(v.key[1])) for v in (a, b)]
    return all(lanes) and (lanes[0][1], lanes[1][1], lanes[0][2]) == ("low", "high", lanes[1][2])


def inner(row: dict, vector) -> Value:
    """As dot(), with neighbours that are pairs in both multiplied at once."""
    row = nonzero(row)
    pairs, rest = [], []
    for k, c in row.items():
        even, odd = k - k % 2, k - k % 2 + 1
        if {even, odd} <= row.keys() and is_pair(vector(even), vector(odd)):
            if k == even:
                pairs.append(pair(c, row[odd]) * pair(vector(even), vector(odd)))
        else:
            rest.append(c * vector(k))
    if pairs:
        both = total(pairs)
        rest.append(both[0] + both[1])
    return total(rest)
