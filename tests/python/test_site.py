"""The site builds in strict mode, a fault in the pages fails it; pages that list things list all."""

import os
import re
import shutil
import subprocess
import sys

import pytest
import yaml
from equipoise_tools.site_hooks import without_outer_links


@pytest.fixture(scope="module")
def build(root, tmp_path_factory):
    """build(change) -> (exit code, complaints, folder): the site of docs/ after change(folder of pages)."""

    def run(change=lambda pages: None):
        tree = tmp_path_factory.mktemp("site")
        pages = tree / "build/site/docs"
        shutil.copytree(root / "docs", pages)
        shutil.copy(root / "mkdocs.yml", tree)
        (tree / "tools/equipoise_tools").mkdir(parents=True)
        shutil.copy(root / "tools/equipoise_tools/site_hooks.py", tree / "tools/equipoise_tools")
        reference = subprocess.run(
            [root / "build/host/equipoise", "man", "--to", "markdown"], capture_output=True, check=True
        )
        (pages / "reference.md").write_bytes(reference.stdout)
        change(pages)
        ended = subprocess.run(
            [sys.executable, "-m", "mkdocs", "build", "--strict"],
            cwd=tree,
            capture_output=True,
            text=True,
            env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
            check=False,
        )
        return ended.returncode, ended.stderr, tree / "build/site/html"

    return run


def test_the_site_builds_and_needs_nothing_from_elsewhere(build):
    status, complaints, html = build()
    assert status == 0, complaints
    page = (html / "tutorials/see-and-tune.html").read_text()
    loaded = re.findall(r"<(?:script|img|link)[^>]*?(?:src|href)=\"?([^\"\s>]+)", page)
    assert loaded
    assert not [address for address in loaded if address.startswith(("http:", "https:", "//"))]
    assert "--drive-mps" in (html / "reference.html").read_text()


def test_a_dead_link_fails_the_site(build):
    def break_links(pages):
        page = pages / "python.md"
        page.write_text(page.read_text() + "\n[nowhere](nowhere.md) [no heading](blackbox.md#none)\n")
        (pages / "forgotten.md").write_text("# In no navigation\n")

    status, complaints, _ = build(break_links)
    assert status != 0
    assert "nowhere.md" in complaints
    assert "#none" in complaints
    assert "forgotten.md" in complaints


def test_links_out_of_the_docs_become_names():
    text = "[tools/run](../tools/run), [the loop](../include/x.hpp), [here](filter.md#a), ![p](../x.png)\n"
    assert without_outer_links(text, "page.md") == (
        "`tools/run`, the loop (`include/x.hpp`), [here](filter.md#a), ![p](../x.png)\n"
    )
    assert without_outer_links("[f](../filter.md) [g](../../g)", "tutorials/t.md") == "[f](../filter.md) `g`"
    assert without_outer_links("```sh laptop\nls\n```", "page.md") == "```sh\nls\n```"
    assert without_outer_links("```\n[x](../y)\n```", "page.md") == "```\n[x](../y)\n```"


def test_the_citation_file_says_what_the_project_says(root):
    citation = yaml.safe_load((root / "CITATION.cff").read_text())
    cmake = (root / "CMakeLists.txt").read_text()
    assert citation["version"] == re.search(r"project\(equipoise VERSION ([\d.]+)", cmake)[1]
    assert citation["license"] == "BSD-3-Clause"
    assert (root / "LICENSE").read_text().startswith("BSD 3-Clause")
