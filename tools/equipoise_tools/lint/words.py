"""One word for one thing: terms that pages and the product's code do not use (docs/glossary.md)."""

from __future__ import annotations

import re

from .tree import C_SUFFIXES, Finding, Tree

Terms = tuple[tuple[re.Pattern[str], str], ...]


def terms(*pairs: tuple[str, str]) -> Terms:
    """Pattern of a term, what to write instead."""
    return tuple((re.compile(rf"(?<![\w-])(?:{term})(?![\w-])", re.I), instead) for term, instead in pairs)


_EVERYWHERE = (
    (r"fly|flies|flew|flown|flying|flights?", "run"),
    (r"rid(?:e|es|den|ing) through|ride-through", "tolerated"),
    (r"in the room|room frame", "world frame"),
    (r"crooked(?:ly)?", "misaligned"),
    (r"further delay", "delay margin"),
)
CODE_TERMS = terms(*_EVERYWHERE)
TERMS = terms(
    *_EVERYWHERE,
    *(
        (r"lie[sd]?|liars?|lying|honest(?:ly)?", "faulty, inconsistent, healthy; resting (of a body)"),
        (r"left out|leav(?:e|es|ing) out|do(?:es|ing)? without", "excluded, omitted"),
        (r"surprises?|surprised|condemn(?:s|ed)?|blame[sd]?", "innovation, likelihood ratio, isolated"),
        (r"odds|evidence", "likelihood ratio"),
        (r"witness(?:es|ed)?|hear[sd]?|feels?|felt|spoil(?:s|t)?|obey(?:s|ed|ing)?", "measure, apply"),
        (r"rooms?|house rules?", "module, folder, layout, rules"),
        (r"the play|much play|play (?:at|in|of)|play is", "backlash"),
        (r"as printed|printed (?:ekf|kf|filter|gains|form|one|model|planar|sign)", "as published, published"),
        (r"lean(?:s|ed|ing)?", "tilt"),
        (r"let(?:s|ting)? go", "disarm, release"),
        (r"wish(?:es|ed)?|culprits?|conversations?|dead m[ae]n|anecdotes?", "request, faulty part, timeout"),
        (r"ohm-meter|low pass(?!es)|pictures a second|not released", "ohmmeter, low-pass, fps, Unreleased"),
        (r"as far as|whoever|slip of the pen|hands off|nobody|somebody", "plain words"),
        (r"MIPs?", "eduMIP"),
    ),
)  # fmt: skip
PRODUCT = ("src/", "include/", "drivers/")
CODE = (*PRODUCT, "tests/", "tools/equipoise_tools/", "python/", "examples/")
COCKPIT = "tools/equipoise_tools/cockpit/page/"
SAYS_OLD_WORDS = ("tools/equipoise_tools/lint/words.py", "tests/python/test_lint.py")
JSON_KEYS_KEPT = '"flights"'
GENERATED = ("docs/experiments/", "docs/reports/", "docs/parameters.md", "docs/reasons.md")
_MESSAGE = re.compile(r'"((?:[^"\\\n]|\\.)+)"')  # a string
_INTERNAL = re.compile(r"^\s*(?://|#include)|static_assert\(")
_CODE = re.compile(r"```.*?```|`[^`\n]*`|\]\([^)\s]*\)|<!--.*?-->", re.S)


def pages(tree: Tree) -> list[str]:
    """Hand-written pages."""
    names = [n for n in tree.files if n.endswith(".md") and (n.startswith("docs/") or "/" not in n)]
    return sorted(name for name in names if not name.startswith(GENERATED))


def without_code(text: str) -> str:
    """The same lines with code and link targets blanked."""
    return _CODE.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def messages(text: str) -> str:
    """Of code: what users may read, line by line."""
    return "\n".join(
        "" if _INTERNAL.search(line) else " | ".join(m for m in _MESSAGE.findall(line) if " " in m.strip())
        for line in text.splitlines()
    )


def in_words(line: str) -> str:
    """Of code: its identifiers as words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", line.replace(JSON_KEYS_KEPT, "").replace("_", " "))


def found(name: str, text: str, patterns: Terms) -> list[Finding]:
    return [
        Finding(name, number, f"says '{match[0]}'; write: {instead}")
        for number, line in enumerate(text.splitlines(), 1)
        for pattern, instead in patterns
        for match in pattern.finditer(line)
        if match[0] not in ("mip", "Mip")  # a command's word
    ]


def words(tree: Tree) -> list[Finding]:
    findings = []
    for name in pages(tree):
        findings += found(name, without_code(tree.text(name)), TERMS)
    for name in (n for n in tree.ending(".toml") if n.startswith("config/")):
        comments = "\n".join(line.partition("#")[2] for line in tree.text(name).splitlines())
        findings += found(name, without_code(comments), TERMS)
    for name in tree.ending(*C_SUFFIXES, ".py", ".js", ".sh"):
        if not name.startswith(CODE) or name in SAYS_OLD_WORDS:
            continue
        findings += found(name, in_words(tree.text(name)), CODE_TERMS)
        if name.startswith((*PRODUCT, COCKPIT)):
            findings += found(name, messages(tree.text(name)), TERMS)
    return findings
