"""One word for one thing: terms that pages do not use, and what to write instead (docs/glossary.md)."""

from __future__ import annotations

import re

from .tree import Finding, Tree

# Pattern of a term, what to write instead.
TERMS = tuple(
    (re.compile(rf"(?<![\w-])(?:{term})(?![\w-])", re.I), instead)
    for term, instead in (
        (r"lie[sd]?|liars?|lying|honest(?:ly)?", "faulty, inconsistent, healthy; resting (of a body)"),
        (r"fly|flies|flew|flown|flying|flights?", "run"),
        (r"rid(?:e|es|den|ing) through|ride-through", "tolerated"),
        (r"left out|leav(?:e|es|ing) out|do(?:es|ing)? without", "excluded, omitted"),
        (r"surprises?|surprised|condemn(?:s|ed)?|blame[sd]?", "innovation, likelihood ratio, isolated"),
        (r"witness(?:es|ed)?|hear[sd]?|feels?|felt|spoil(?:s|t)?|obey(?:s|ed|ing)?", "measure, apply"),
        (r"rooms?|house rules?", "module, folder, layout, rules"),
        (r"in the room|room frame", "world frame"),
        (r"the play|play (?:at|in|of)|play is", "backlash"),
        (r"crooked(?:ly)?", "misaligned"),
        (r"as printed|printed (?:ekf|kf|filter|gains|form|one|model|planar|sign)", "as published, published"),
        (r"further delay", "delay margin"),
        (r"lean(?:s|ed|ing)?", "tilt"),
        (r"let(?:s|ting)? go", "disarm, release"),
        (r"wish(?:es|ed)?|culprits?|conversations?|dead m[ae]n|anecdotes?", "request, faulty part, timeout"),
        (r"ohm-meter|low pass(?!es)|pictures a second|not released", "ohmmeter, low-pass, fps, Unreleased"),
        (r"as far as|whoever|slip of the pen|hands off|nobody|somebody", "plain words"),
        (r"MIPs?", "eduMIP"),
    )
)  # fmt: skip
UNREVISED = ("docs/faults.md",)  # is rewritten with the detector
GENERATED = ("docs/experiments/", "docs/reports/", "docs/parameters.md", "docs/reasons.md")
_CODE = re.compile(r"```.*?```|`[^`\n]*`|\]\([^)\s]*\)|<!--.*?-->", re.S)


def pages(tree: Tree) -> list[str]:
    """Hand-written pages."""
    names = [n for n in tree.files if n.endswith(".md") and (n.startswith("docs/") or "/" not in n)]
    return sorted(name for name in names if not name.startswith(GENERATED))


def without_code(text: str) -> str:
    """The same lines with code and link targets blanked."""
    return _CODE.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def words(tree: Tree) -> list[Finding]:
    findings = []
    for name in pages(tree):
        if name in UNREVISED:
            continue
        for number, line in enumerate(without_code(tree.text(name)).splitlines(), 1):
            for pattern, instead in TERMS:
                findings += [
                    Finding(name, number, f"says '{match[0]}'; write: {instead}")
                    for match in pattern.finditer(line)
                    if match[0] not in ("mip", "Mip")  # a command's word
                ]
    return findings
