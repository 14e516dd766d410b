"""What the straight-line filters of both robots share: rows of a model, and the layout of the headers."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from . import emit
from .model_header import Model
from .packed import Covariance, Projected, heun_state
from .straight import Emitter, pair, total

DT = 0.005  # kTickS; the header asserts it


class ModelRows:
    """Outputs of a small-angle model and their Jacobian, with named coefficients."""

    def __init__(self, model: Model, index: int):
        rows = model.rows[index]
        self.model = model
        self.terms = [
            {m: sp.Symbol(f"c.{name}_{label}") for label, m, _ in model.terms(e)}
            for name, e in zip(rows.names, rows.expressions, strict=True)
        ]

    def evaluate(self, em: Emitter, x, u, scale: float = 1.0, together=()):
        """scale times outputs and Jacobian; outputs are affine in the small states.

        together: pairs of rows with the same products of states and inputs, computed at once.
        """
        values = dict(zip((*self.model.state, *self.model.inputs), (*x, *u), strict=True))
        outputs: list = [None] * len(self.terms)
        J: list = [None] * len(self.terms)
        alone = set(range(len(self.terms))) - {i for pair in together for i in pair}
        for rows in [*((i,) for i in sorted(alone)), *together]:
            output, row = self._row(em, values, scale, rows)
            for lane, i in enumerate(rows):
                outputs[i] = output if len(rows) == 1 else output[lane]
                J[i] = row if len(rows) == 1 else [v[lane] for v in row]
        return outputs, J

    def _row(self, em: Emitter, values: dict, scale: float, rows):
        model = self.model
        products = list(dict.fromkeys(m for i in rows for m in self.terms[i]))

        def value(factor_of):
            """The sum over the products of what factor_of leaves of them, times their coefficients."""
            parts = []
            for m in products:
                number, rest = sp.sympify(factor_of(m)).as_coeff_Mul()
                if number == 0:
                    continue
                lanes = [em.of(scale * number * self.terms[i].get(m, 0), values) for i in rows]
                coefficient = lanes[0] if len(rows) == 1 else pair(*lanes)
                parts.append(coefficient * em.of(rest, values))
            return total(parts) if parts else em.constant(0.0)

        J = [value(lambda m, v=v: sp.diff(m, v)) for v in model.state]
        rest = value(lambda m: 0 if m.free_symbols & set(model.small) else m)
        small = [(J[j], values[v]) for j, v in enumerate(model.state) if v in model.small]
        return total([*(a * b for a, b in small), rest]), J


@dataclass(frozen=True)
class Filter:
    """A filter's states, and the two functions of one step as (early lines, how many they keep, lines)."""

    robot: str
    states: list[str]  # in the model's order
    motion: int  # the first of them
    inputs: int
    outputs: int
    B: list[tuple[int, int]]  # where a unit of u moves a state within a tick, upright: (state, input)
    constants: list[str]  # further members of Constants
    ahead: Emitter
    predict: Emitter
    innovate: Emitter
    restore: Emitter
    precise: dict[int, tuple[int, list[int]]]  # row -> state that it all but measures, its columns
    scripts: tuple[str, ...]  # which it comes from

    @property
    def noise(self) -> list[tuple[int, int]]:
        return noise_places(len(self.states), self.B)


def noise_places(n: int, B) -> list[tuple[int, int]]:
    """Where Q has entries: the diagonal, and what one input moves together."""
    pairs = {(i, i) for i in range(n)}
    for b in {i for _, i in B}:
        states = [r for r, i in B if i == b]
        pairs |= {(i, j) for i in states for j in states if i <= j}
    return sorted(pairs)


def add_noise(em: Emitter, P: Covariance, B) -> None:
    for place, (i, j) in enumerate(noise_places(P.n, B)):
        P[i, j] = P[i, j] + em.variable(f"k.Q[{place}]", early=True)


def ahead(derivative, motion: int, inputs: int) -> Emitter:
    """The motion's states after dt; derivative(em, u): that of the robot."""
    em = Emitter("k.ahead")
    u = [em.variable(f"u[{i}]") for i in range(inputs)]
    x = [em.variable(f"x[{i}]") for i in range(motion)]
    for i, value in enumerate(heun_state(x, derivative(em, u), em.variable("dt"))):
        em.store(f"x[{i}]", value)
    return em


def _places(name: str, about: str, places) -> list[str]:
    text = ", ".join(f"{{{i}, {j}}}" for i, j in places)
    lines = emit.statement(f"static constexpr int {name}[{len(places)}][2] = {{{text}}};")
    return [f"  /// {about}.", *lines]


def _kept(filter: Filter) -> list[str]:
    lines = ["    // By prepare():"]
    for name in _steps(filter):
        code = getattr(filter, name).lines()
        if code.pairs:
            lines.append(f"    alignas(2 * sizeof(Real)) Real {name}_pairs[{2 * code.pairs}];")
        if code.values:
            lines.append(f"    Real {name}[{code.values}];")
    return lines


def _file(filter: Filter, suffix: str, about: list[str], includes: list[str], body: list[str]) -> str:
    about = [*about, "SI, rad. Source: docs/derivation.md, docs/filter.md. RT-safe."]
    script = f"{filter.robot}_filter.py"
    text = emit.header(about, script, emit.input_hash(*filter.scripts), "equipoise::generated", body, ())
    once = ["#pragma once", ""] if suffix == "hpp" else []
    return text.replace("#pragma once\n", "\n".join([*once, *includes, ""]), 1)


def _steps(filter: Filter) -> dict[str, list[tuple[str, str]]]:
    """Of every step, what it takes: type and name."""
    n, m, p = len(filter.states), filter.outputs, filter.inputs
    k, entries = len(filter.precise), sum(len(columns) for _, columns in filter.precise.values())
    constants = ("const Constants<Real>&", "k")
    return {
        "ahead": [constants, ("const Real", f"u[{p}]"), ("Real", "dt"), ("Real", f"x[{filter.motion}]")],
        "predict": [constants, ("const Real", f"u[{p}]"), ("Real", f"x[{n}]"), ("Real*", "P")],
        "innovate": [
            constants,
            ("const Real", f"u[{p}]"),
            ("const Real", f"y[{m}]"),
            ("const bool", f"use[{m}]"),
            ("const Real", f"R[{m}]"),
            ("const Real", f"x[{n}]"),
            ("const Real*", "P"),
            ("Real*", "Ph"),
            ("Real", f"weight[{m}]"),
            ("Real", f"step[{m}]"),
            ("Real", f"row_innovation[{m}]"),
            ("Real", f"row_variance[{m}]"),
            ("Real", f"row_nis[{m}]"),
            ("Real", f"h[{entries}]"),
            ("Real", f"gain[{k * m}]"),
        ],
        "restore": [
            ("const bool", f"use[{k}]"),
            ("const Real", f"h[{entries}]"),
            ("const Real", f"exact[{k * n}]"),
            ("Real*", "P"),
        ],
    }


def _declaration(name: str, takes: list[tuple[str, str]], real: str, indent: int = 2) -> list[str]:
    text = ", ".join(f"{kind} {what}".replace("Real", real) for kind, what in takes)
    return emit.statement(f"void {name}({text}) noexcept", indent)


def render(filter: Filter) -> str:
    n, m, p = len(filter.states), filter.outputs, filter.inputs
    precise = [(i, state) for i, (state, _) in filter.precise.items()]
    entries = sum(len(columns) for _, columns in filter.precise.values())
    name = filter.robot.capitalize()
    about = {
        "ahead": ["x after dt with what acts, input and disturbance."],
        "predict": ["x, P after a tick with input u."],
        "innovate": [
            "What the samples y with variances R change, if their flag is set: x gains the sum of",
            "step Ph over the rows, P loses that of weight Ph Ph'. Innovation and variance of a row: given",
            "the rows before it whose flag is set. weight, step, row_nis: 0 where the flag is clear.",
            f"Ph[{n // 2}][{m}][2]: pairs of states, rows, state of the pair. h, gain: for restore().",
        ],
        "restore": [
            "Rows of P whose digits the correction lost: kPrecise, of those whose flag is set. exact: the",
            "sum of gain Ph over the rows.",
        ],
    }
    steps: list[str] = []
    for step, takes in _steps(filter).items():
        steps += [f"  /// {line}" for line in about[step]]
        for real in ("double", "float"):
            first, *rest = _declaration(step, takes, real)
            steps += [first.replace("void", "static void", 1), *rest]
            steps[-1] += ";"
    body = [
        f"struct {name}Filter {{",
        f"  static constexpr int kStates = {n};",
        f"  static constexpr int kMotion = {filter.motion};  // states that move, the first",
        f"  static constexpr int kInputs = {p};",
        f"  static constexpr int kOutputs = {m};",
        f"  static constexpr int kTriangle = {Covariance.size(n)};  // of P, upper, rows from even columns",
        "  // Pointers point there, to the middle: offsets of VFP's loads reach 1020 bytes, both ways.",
        f"  static constexpr int kMiddleP = {Covariance.middle(n)};",
        f"  static constexpr int kMiddlePh = {Projected.middle(n, m)};",
        f"  static constexpr double kTickS = {DT};",
        *_places("kB", "Entries of B: state, input", filter.B),
        *_places("kQ", "Entries of Q: row, column", filter.noise),
        *_places("kPrecise", "Row, and the state that it all but measures", precise),
        f"  static constexpr int kEntries = {entries};  // of those rows",
        "",
        "  /// Nothing but numbers, all of one type.",
        "  template <class Real>",
        "  struct Constants {",
        f"    {filter.robot}::Coefficients<Real> c;",
        *[f"    {line}" for line in filter.constants],
        f"    Real B[{len(filter.B)}];",
        f"    Real Q[{len(filter.noise)}];",
        *_kept(filter),
        "  };",
        "  /// Fills in what follows from the rest.",
        "  static void prepare(Constants<double>& k) noexcept;",
        *steps,
        "};",
        "",
    ]
    about_file = [
        f"Layout of the {filter.robot.upper()}'s straight-line filter in {filter.robot}_filter.cpp."
    ]
    return _file(filter, "hpp", about_file, [f'#include "generated/{filter.robot}_model.hpp"'], body)


def render_code(filter: Filter) -> str:
    name = filter.robot.capitalize() + "Filter"
    lines = {step: getattr(filter, step).lines() for step in _steps(filter)}
    early = [line for code in lines.values() for line in ("  {", *code.early, "  }") if code.early]
    body = [
        "template <class Real>",
        f"using Constants = {name}::Constants<Real>;",
        "",
        f"void {name}::prepare(Constants<double>& k) noexcept {{",
        *early,
        "}",
        "",
    ]
    for step, takes in _steps(filter).items():
        body += ["template <class Real>"]
        declaration = _declaration(f"{step}_of", takes, "Real", indent=0)
        declaration[0] = f"[[gnu::always_inline]] inline {declaration[0]}"
        body += [line for text in declaration for line in emit.statement(text, 0)]
        body[-1] += " {"
        body += ["  using One = OneOf<Real>;", "  using Two = TwoOf<Real>;", *lines[step].late, "}", ""]
        names = ", ".join(what.partition("[")[0] for _, what in takes)
        for real in ("double", "float"):
            body += ["EQUIPOISE_AVX512_TOO", *_declaration(f"{name}::{step}", takes, real, indent=0)]
            body[-1] += " {"
            body += [f"  {step}_of({names});", "}", ""]
    about = [
        f"One step of the {filter.robot.upper()}'s default filter, straight-line: Heun's third order,",
        "F P F' as row operations on a packed triangle, scalar measurements with masks instead of branches.",
        f"The model in robots/{filter.robot}/ekf.hpp is the readable form and the reference in tests.",
    ]
    includes = [
        f'#include "generated/{filter.robot}_filter.hpp"',
        "",
        '#include "equipoise/estimate/lanes.hpp"',
    ]
    return _file(filter, "cpp", about, includes, body)
