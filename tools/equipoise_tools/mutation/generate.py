"""Mutants of a C or C++ source by its tokens: one small change each, all of them, in the order of the text.

Sources are formatted by clang-format, which decides what tokens alone cannot: an operator of two operands has
white space on both sides, a template's bracket, a pointer and a sign have not.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

# What is not code, or is code whose change the compiler, not a test, has to see.
SKIPPED = re.compile(
    r"""//[^\n]* | /\*.*?\*/ | R"(?P<raw>[^(]*)\(.*?\)(?P=raw)" | "(?:\\.|[^"\\\n])*" | '(?:\\.|[^'\\\n])'
    | ^[ \t]*\#(?:\\\n|[^\n])* | \b(?:static_assert|static_cast|reinterpret_cast|const_cast)\b(?:<[^;()]*>)?
    | \btemplate\s*<[^;{]*?>\s*\n | \boperator\s*[^\w\s(]+""",
    re.X | re.S | re.M,
)
SWAPPED = dict(
    pair.split()
    for pair in (
        *("< <=", "<= <", "> >=", ">= >", "== !=", "!= =="),
        *("+ -", "- +", "* /", "/ *", "% *", "&& ||", "|| &&", "& |", "| &", "<< >>", ">> <<"),
        *("+= -=", "-= +=", "*= /=", "/= *=", "|= &=", "&= |="),
    )
)
KINDS = {
    **dict.fromkeys(("<", "<=", ">", ">=", "==", "!="), "relation"),
    **dict.fromkeys(("&&", "||"), "logic"),
}
OPERATOR = re.compile(r"(?<=\s)(<<|>>|[<>=!+\-*/|&]=|&&|\|\||[<>+\-*/%&|])(?=\s)")
STEP = re.compile(r"(?<![\w)\]+-])(\+\+|--)(?=[\w(*])|(?<=[\w)\]])(\+\+|--)(?!\w)")
NUMBER = re.compile(r"(?<![\w.'])(0[xX][0-9a-fA-F']+|\d[\d']*\.?\d*(?:[eE][+-]?\d+)?)([uUlLfF]*)(?![\w.])")
CONDITION = re.compile(r"\b(if|while)( constexpr)? \(")
PLACE = r"\*?\(?[A-Za-z_]\w*(?:(?:\.|->|::)\w+|\[[^;\[\]]*\])*\)?"
STATEMENT = re.compile(
    rf"(?<=[;{{}})])\s+(?:else )?"
    rf"(?P<what>{PLACE} [+\-*/|&]?= [^;{{}}]+;|{PLACE}\([^;{{}}]*\);|(?:break|continue);)"
)
NO_STATEMENT = re.compile(r"(?:return|throw|using|delete|case|goto|else|static_assert|if|for|while|switch)\b")


@dataclass(frozen=True)
class Mutant:
    line: int
    kind: str
    begin: int
    end: int
    old: str
    new: str

    def of(self, text: str) -> str:
        return text[: self.begin] + self.new + text[self.end :]

    @property
    def change(self) -> str:
        """On one line, to read."""
        old, new = (" ".join(part.split()) for part in (self.old, self.new))
        return f"{old} → {new or 'nothing'}"


def blank(text: str) -> str:
    """The code of the same length: what is skipped is spaces, in a place where no token is looked for."""
    return SKIPPED.sub(lambda m: re.sub(r"[^\n]", "\0", m.group()), text)


def closing(code: str, at: int) -> int | None:
    """Where the bracket that opens at `at` ends."""
    depth = 0
    for i in range(at, len(code)):
        depth += {"(": 1, ")": -1}.get(code[i], 0)
        if depth == 0:
            return i
    return None


def another_number(digits: str, suffix: str) -> str:
    whole = digits.replace("'", "")
    if whole.lower().startswith("0x"):
        return hex(int(whole, 16) + 1) + suffix
    if re.search(r"[.eE]", whole) or "f" in suffix.lower():
        return (repr(2 * float(whole)) if float(whole) != 0 else "1.0") + suffix
    if len(whole) > 1 and whole[0] == "0":
        return oct(int(whole, 8) + 1).replace("0o", "0") + suffix
    return str(int(whole) + 1) + suffix


def mutants(text: str) -> list[Mutant]:
    code = blank(text)
    found = []

    def add(kind: str, begin: int, end: int, new: str) -> None:
        found.append(Mutant(text.count("\n", 0, begin) + 1, kind, begin, end, text[begin:end], new))

    for m in OPERATOR.finditer(code):
        add(KINDS.get(m[1], "arithmetic"), *m.span(1), SWAPPED[m[1]])
    for m in STEP.finditer(code):
        group = 1 if m[1] else 2
        add("arithmetic", *m.span(group), "--" if m[group] == "++" else "++")
    for m in NUMBER.finditer(code):
        add("constant", *m.span(), another_number(m[1], m[2]))
    for m in CONDITION.finditer(code):
        end = closing(code, m.end() - 1)
        inside = code[m.end() : end]
        if m[2] or end is None or re.search(r"[^=<>!]=[^=]|;", inside):  # a declaration in the condition
            continue
        if re.search(r" [=!]= ", inside) and not re.search(r"&&|\|\|", inside):  # the relation's own mutant
            continue
        add("condition", m.end(), end, f"!({text[m.end():end]})")
    for m in STATEMENT.finditer(code):
        if not NO_STATEMENT.match(m["what"]):
            add("statement", *m.span("what"), ";")
    return sorted(found, key=lambda each: (each.begin, each.end, each.kind))
