"""A small-angle model as C++: parameters, coefficients by name, and functions with their Jacobians."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from . import emit


@dataclass(frozen=True)
class Rows:
    """One generated function: outputs that are affine in the small states, with a Jacobian in the states."""

    function: str
    output: str  # name of the output array
    names: list[str]  # of the rows, used in the coefficients' names
    expressions: list
    comment: str
    # A restriction of earlier rows to fewer states and inputs: uses their coefficients.
    state: tuple | None = None
    inputs: tuple | None = None


@dataclass(frozen=True)
class Model:
    parameters: list[str]
    state: tuple
    inputs: tuple
    small: tuple
    rows: list[Rows]
    lumped: dict  # name -> expression of the parameters
    denominators: dict  # name -> expression of the lumped parameters
    parameter_comments: dict

    def coefficients(self) -> list[tuple[str, sp.Expr]]:
        """(name, value in parameters and lumped parameters), in order of appearance."""
        return [
            (f"{name}_{label}", value)
            for rows in self.rows
            if rows.state is None
            for name, e in zip(rows.names, rows.expressions, strict=True)
            for label, _, value in self.terms(e)
        ]

    def terms(self, expression):
        """[(label, monomial, coefficient)] in state and input."""
        variables = self.state + self.inputs
        result = []
        for powers, value in sp.Poly(sp.expand(expression), *variables).terms():
            factors = [(v, k) for v, k in zip(variables, powers, strict=True) if k]
            label = "_".join(f"{v}{k if k > 1 else ''}" for v, k in factors)
            value = self._readable(value)
            if value != 0:
                result.append((label, sp.Mul(*[v**k for v, k in factors]), value))
        return result

    def _readable(self, value):
        """One fraction, factored, with the determinants named."""
        top, bottom = sp.fraction(sp.factor(value))
        names = {expression: sp.Symbol(name) for name, expression in self.denominators.items()}
        return sp.factor_terms(top) / bottom.subs(names)

    def numbers(self, values: dict) -> dict[str, float]:
        """Every coefficient's value for given parameters."""
        known = {sp.Symbol(k, positive=True): v for k, v in values.items()}
        lumped = {sp.Symbol(k, positive=True): e.subs(known) for k, e in self.lumped.items()}
        denominators = {sp.Symbol(k): e.subs(lumped | known) for k, e in self.denominators.items()}
        return {k: float(e.subs(denominators).subs(lumped | known)) for k, e in self.coefficients()}

    def body(self) -> list[str]:
        lines = ["/// Physical parameters, SI.", "struct Parameters {"]
        for name in self.parameters:
            comment = self.parameter_comments.get(name)
            lines.append(f"  double {name};" + (f"  // {comment}" if comment else ""))
        lines += ["};", "", *self._coefficients()]
        for rows in self.rows:
            lines += ["", *self._function(rows)]
        return [*lines, ""]

    def _coefficients(self) -> list[str]:
        pairs = self.coefficients()
        lines = ["/// Named row_term: the factor of that product of states and inputs in that row."]
        lines += [
            "template <class T>",
            "struct Coefficients {",
            *[f"  T {name};" for name, _ in pairs],
            "};",
            "",
        ]
        lines += ["template <class T>", "inline Coefficients<T> coefficients(const Parameters& p) noexcept {"]
        used = {str(s) for _, e in pairs for s in e.free_symbols}
        named = [(k, e) for k, e in self.denominators.items() if k in used]
        used |= {str(s) for _, e in named for s in e.free_symbols}
        lumped = [(k, e) for k, e in self.lumped.items() if k in used]
        used |= {str(s) for _, e in lumped for s in e.free_symbols}
        lines += [f"  const double {name} = p.{name};" for name in self.parameters if name in used]
        for name, expression in lumped + named:
            lines += emit.statement(f"const double {name} = {emit.code(expression, 'double')};")
        lines += ["  Coefficients<T> c;"]
        for name, expression in pairs:
            lines += emit.statement(f"c.{name} = static_cast<T>({emit.code(expression, 'double')});")
        return [*lines, "  return c;", "}"]

    def _function(self, rows: Rows) -> list[str]:
        """The outputs are affine in the small states, so each is its own Jacobian times them, plus a rest."""
        state, inputs = rows.state or self.state, rows.inputs or self.inputs
        pairs, outputs = [], []
        for i, (name, e) in enumerate(zip(rows.names, rows.expressions, strict=True)):
            symbolic = sum(sp.Symbol(f"c.{name}_{label}") * monomial for label, monomial, _ in self.terms(e))
            symbolic = sp.sympify(symbolic)
            pairs += [(f"J[{i}][{j}]", sp.diff(symbolic, v)) for j, v in enumerate(state)]
            rest = symbolic.subs(dict.fromkeys(self.small, 0))
            by_jacobian = [
                f"J[{i}][{j}] * {v}"
                for j, v in enumerate(state)
                if v in self.small and sp.diff(symbolic, v) != 0
            ]
            outputs.append((f"{rows.output}[{i}]", rest, by_jacobian))
        rests = [(f"const T rest_{i}", rest) for i, (_, rest, _) in enumerate(outputs) if rest != 0]
        used = set().union(*[e.free_symbols for _, e in pairs + rests])
        used |= {v for v in self.small if any(p.endswith(f" {v}") for _, _, by in outputs for p in by)}
        n, m = len(state), len(rows.names)
        head = f"inline void {rows.function}(const Coefficients<T>& c, const T x[{n}], "
        head += f"const T u[{len(inputs)}],"
        pad = " " * (head.index("(") + 1)
        lines = [f"/// {rows.comment}", "template <class T>", head]
        lines += [f"{pad}T {rows.output}[{m}], T J[{m}][{n}]) noexcept {{"]
        lines += emit.unpack(state, "x", used) + emit.unpack(inputs, "u", used)
        lines += emit.shared(pairs + rests, "k")
        for i, (target, rest, by_jacobian) in enumerate(outputs):
            terms = by_jacobian + ([f"rest_{i}"] if rest != 0 else [])
            lines += emit.statement(f"{target} = {' + '.join(terms)};")
        return [*lines, "}"]
