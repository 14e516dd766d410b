"""MkDocs hooks: a link out of docs/, right in the repository, becomes the file's name on the site."""

from __future__ import annotations

import posixpath
import re

_LINK = re.compile(r"(?<!!)\[((?:[^\]\[]|\[[^\]]*\])*)\]\(<?([^)>\s]+)>?\)")
_WHERE_IT_RUNS = re.compile(r"^(```\w+) \w+$", re.M)  # "sh laptop": for a test
_CODE_BLOCK = re.compile(r"(```.*?```)", re.S)


def without_outer_links(text: str, page: str) -> str:
    """`page`: its path in docs/."""

    def named(match: re.Match[str]) -> str:
        words, target = match[1], match[2]
        if re.match(r"[a-z][a-z0-9+.-]*:|#", target):
            return match[0]
        path = posixpath.normpath(posixpath.join("docs", posixpath.dirname(page), target.split("#")[0]))
        if path.startswith("docs/"):
            return match[0]
        bare = words.strip("`")
        return f"`{path}`" if path.endswith(bare.lstrip("./")) else f"{words} (`{path}`)"

    blocks = _CODE_BLOCK.split(_WHERE_IT_RUNS.sub(r"\1", text))
    return "".join(part if part.startswith("```") else _LINK.sub(named, part) for part in blocks)


def on_page_markdown(markdown: str, page, **_) -> str:
    return without_outer_links(markdown, page.file.src_uri)
