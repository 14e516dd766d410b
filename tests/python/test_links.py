"""Every relative link in the tracked pages leads to a tracked file, and to a heading that is there."""

import re
import subprocess
from pathlib import Path

import pytest

_LINK = re.compile(
    r"!?\[(?:[^\]\[]|\[[^\]]*\])*\]\(<?([^)>\s]+)>?(?:\s+\"[^\"]*\")?\)|^\[[^\]]+\]:\s+(\S+)", re.M
)
_CODE = re.compile(r"```.*?```|`[^`\n]*`", re.S)


def tracked(root: Path) -> set[str]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True, check=True)
    return set(filter(None, listed.stdout.split("\0")))


def anchors(text: str) -> set[str]:
    """Of a page's headings, as GitHub makes them."""
    found: set[str] = set()
    for heading in re.findall(r"^#{1,6}\s+(.*?)\s*#*$", re.sub(r"```.*?```", "", text, flags=re.S), re.M):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        name = re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
        number = 0
        while (unique := name if number == 0 else f"{name}-{number}") in found:
            number += 1
        found.add(unique)
    return found


def broken(root: Path, page: str, files: set[str]) -> list[str]:
    """The links of a page that lead nowhere."""
    text = (root / page).read_text()
    out = []
    for match in _LINK.finditer(_CODE.sub("", text)):
        link = match[1] or match[2]
        if re.match(r"[a-z][a-z0-9+.-]*:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (root / page).parent.joinpath(path).resolve() if path else (root / page).resolve()
        name = target.relative_to(root.resolve()).as_posix() if target.is_relative_to(root.resolve()) else ""
        folder = target.is_dir() and any(file.startswith(name + "/") for file in files)
        if name not in files and not folder:
            out.append(f"{page}: {link}: no such file")
        elif anchor and name.endswith(".md") and anchor not in anchors(target.read_text()):
            out.append(f"{page}: {link}: no such heading")
    return out


def test_every_link_leads_somewhere(root):
    files = tracked(root)
    pages = sorted(name for name in files if name.endswith(".md"))
    assert "README.md" in pages and len(pages) > 10
    assert [line for page in pages for line in broken(root, page, files)] == []


def test_every_page_of_docs_is_linked_from_somewhere(root):
    files = tracked(root)
    linked = set()
    for page in (name for name in files if name.endswith(".md")):
        for match in _LINK.finditer(_CODE.sub("", (root / page).read_text())):
            path = (match[1] or match[2]).partition("#")[0]
            target = (root / page).parent.joinpath(path).resolve()
            if path and target.is_relative_to(root.resolve()):
                linked.add(target.relative_to(root.resolve()).as_posix())
    assert sorted(n for n in files if re.fullmatch(r"docs/.*\.md", n) and n not in linked) == []


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("[a](missing.md)", "missing.md: no such file"),
        ("[a](other.md#nowhere)", "other.md#nowhere: no such heading"),
        ("![picture](images/none.png)", "images/none.png: no such file"),
        ("[a](../outside.md)", "../outside.md: no such file"),
        ("[ref]: missing.md", "missing.md: no such file"),
        ("[a](other.md#two-words-1) [b](https://example.org/x.md) `[c](no.md)` [d](#here) [e](folder)", None),
    ],
)
def test_a_broken_link_is_found(tmp_path, line, complaint):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder/file.txt").write_text("")
    (tmp_path / "other.md").write_text("# Two words\n## Two *words*\n```\n# nowhere\n```\n")
    (tmp_path / "page.md").write_text(f"# Here\n{line}\n")
    found = broken(tmp_path, "page.md", {"page.md", "other.md", "folder/file.txt"})
    assert found == ([f"page.md: {complaint}"] if complaint else [])
