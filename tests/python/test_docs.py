"""What hand-written pages name exists: options, keys, files, lines, tests; what they quote is there."""

import math
import re
import shlex
import subprocess
from functools import cache
from pathlib import Path

import pytest
from equipoise_tools import parameters
from equipoise_tools.lint.tree import tree_of_git
from equipoise_tools.lint.words import TERMS, pages, words

# Inline code that looks like a path of the repository.
_PATH = re.compile(r"(?:config|docs|drivers|examples|include|lcm|packaging|python|src|tests|tools)/[\w./-]+")
_KEY_TABLES = "attitude|calibration|chain|controller|estimator|friction|motor|reference|robot|safety|world"
_KEY = re.compile(rf"(?<!equipoise_)(?:{_KEY_TABLES})\.[a-z_][\w.\[\]*]*")
_TEST = re.compile(r"test_\w+\.py::test_\w+")
_LINE = re.compile(r"([\w./-]+\.(?:py|cpp|hpp|h|c|toml|md|txt|lcm|js|sh)):(\d+)")
_NUMBER_LINK = re.compile(
    r"\[([^\]]*\d[^\]]*)\]\(((?:\.\./|docs/)*(?:reports|experiments)/[\w./-]+\.md)(?:#[\w-]+)?\)"
)
_CITED = re.compile(r"\[[^\]]*\]\(((?:\.\./|docs/)*(?:reports|experiments)/[\w./-]+\.md)(?:#[\w-]+)?\)")
_SOURCE_NUMBER = re.compile(
    r"\[([^\]]*\d[^\]]*)\]\(((?:\.\./|docs/)*[\w./-]+\.(?:hpp|cpp|h|c|toml|py|json))\)"
)
_BARE = re.compile(r"[\w-]+\.(?:py|cpp|hpp)")  # a source without its folder
MADE_BY_BUILD = ("build/", "logs/")
OF_DEBIAN = ("/", "~")


@cache
def help_of(command: tuple[str, ...]) -> str | None:
    """None: there is no such command."""
    if not Path(command[0]).is_file():
        return None
    ended = subprocess.run([*command, "--help"], capture_output=True, text=True, timeout=120, check=False)
    ours = len(command) == 1 or re.search(rf"^Usage: \S+ {command[1]}\b", ended.stdout, re.M)
    return ended.stdout if ended.returncode == 0 and ours else None


def code_of(text: str) -> list[tuple[int, str]]:
    """(line, code) of every inline code, which may be wrapped, and line of a shell block."""
    found, shell = [], False
    outside: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        fence = line.startswith("```")
        if fence:
            shell = bool(re.match(r"```(sh|bash)\b", line))
        elif shell:
            found.append((number, re.sub(r"\s+#.*", "", line)))
        outside.append("" if fence or shell else line)
    prose = "\n".join(outside)
    for code in re.finditer(r"`((?:[^`\n]|\n(?!\s*\n))+)`", prose):
        found.append((prose.count("\n", 0, code.start()) + 1, " ".join(code[1].split())))
    return found


def commands_of(code: str) -> list[list[str]]:
    """The words of each of our commands in a line of shell or an inline code."""
    found = []
    for part in re.split(r"\s*(?:&&|\||;)\s*", code):
        try:
            said = shlex.split(part.rstrip("\\& "))
        except ValueError:
            continue
        while said and (said[0] == "sudo" or "=" in said[0].split("/")[0]):
            said = said[1:]
        if said and (
            said[0] in ("equipoise", "build/host/equipoise") or re.match(r"(\./)?tools/[a-z_-]+$", said[0])
        ):
            found.append(said)
    return found


def wrong_options(root: Path, said: list[str]) -> list[str]:
    if said[0].endswith("equipoise"):
        if len(said) < 2 or not re.fullmatch(r"[a-z-]+", said[1]) or said[1].startswith("-"):
            return []
        command = (str(root / "build/host/equipoise"), said[1])
        rest = said[2:]
    else:
        command, rest = (str(root / said[0]),), said[1:]
    if Path(command[0]).is_dir():
        return []
    text = help_of(command)
    if text is None:
        return [f"no command {' '.join(said[:2])}"]
    if said[0].endswith("equipoise") and rest and re.fullmatch(r"[a-z][a-z-]*", rest[0]):
        text += help_of((*command, rest[0])) or ""  # equipoise identify motor
    if "--" in rest:
        rest = rest[: rest.index("--")]  # options of the program behind
    given = [word.split("=")[0] for word in rest if re.match(r"--[a-z]", word)]
    if said[0].endswith("tools/run"):
        text += help_of((str(root / "build/host/equipoise"), "sim")) or ""
    return [
        f"{' '.join(said[:2])} has no {option}"
        for option in given
        if not re.search(rf"(?<![\w-]){option}(?![\w-])", text)
    ]


@cache
def keys() -> frozenset[str]:
    found: set[str] = set()
    for robot in parameters.CONFIGURATIONS:
        found |= set(parameters.keys_of(robot))
    tables = {key.rpartition(".")[0] for key in found}
    return frozenset(found | tables | set(parameters.meanings()))


def wrong_keys(code: str) -> list[str]:
    found = []
    for key in _KEY.findall(
        re.sub(r"\S*/\S*|[\w-]+\.(?:toml|md|py|hpp|cpp|h|lcm|csv|dbc|json|key)\b", " ", code)
    ):
        key = re.sub(r"^world\.\w+\]?$", "world.*", key)
        name = parameters.name_of(key.rstrip(".]") if "[" not in key else key).removesuffix("[]")
        if name not in keys() and not any(known.startswith(name + ".") for known in keys()):
            found.append(f"no configuration key {key}")
    return found


@cache
def sources(root: Path) -> frozenset[str]:
    return frozenset(Path(name).name for name in tree_of_git(root).files)


def wrong_paths(root: Path, page: Path, code: str) -> list[str]:
    found = []
    for path in _PATH.findall(code if not code.startswith((*OF_DEBIAN, *MADE_BY_BUILD)) else ""):
        before = code[: code.index(path)]
        if (
            (before.endswith(("/", "~", ".", "-", "_")) and not before.endswith(("./", " ./")))
            or "*" in code
            or re.search(r"NAME|ROBOT|--out ", code)
        ):
            continue
        path = path.rstrip(".")
        if not any(
            (base / path).exists()
            for base in (root, page.parent, root / "config", root / "src", root / "include/equipoise")
        ):
            found.append(f"no file {path}")
    if (
        _BARE.fullmatch(code)
        and "NAME" not in code
        and code not in sources(root)
        and not (page.parent / code).exists()
    ):
        found.append(f"no file {code}")
    return found


def wrong_lines(root: Path, text: str) -> list[str]:
    found = []
    for path, line in _LINE.findall(text):
        file = root / path
        if not file.is_file() or len(file.read_text(errors="replace").splitlines()) < int(line):
            found.append(f"no line {path}:{line}")
    return found


def wrong_tests(root: Path, text: str) -> list[str]:
    found = []
    for name in _TEST.findall(text):
        file, _, test = name.partition("::")
        path = root / "tests/python" / file
        if not path.is_file() or f"def {test}(" not in path.read_text():
            found.append(f"no test {name}")
    return found


def numbers_before(text: str, end: int) -> list[str]:
    """Those of the sentence, list item or table cell that a link ends."""
    begin = max(text.rfind(mark, 0, end) for mark in ("\n\n", "\n- ", "| ", "\n#"))
    sentence = re.split(r"(?<=[.:;])\s+(?=[A-Z])", text[max(begin, 0) : end])[-1]
    plain = re.sub(r"`[^`]*`|\]\([^)]*\)", " ", sentence)
    return re.findall(r"(?<![\w.\[(-])\d+(?:\.\d+)?(?!\w)", plain)


def wrong_quotes(page: Path, text: str) -> list[str]:
    """Numbers in a link to a report, or in the sentence that cites one, stand together in a section of it."""
    quotes = [(re.findall(r"\d+(?:\.\d+)?", said), link) for said, link in _NUMBER_LINK.findall(text)]
    quotes += [(numbers_before(text, m.start()), m[1]) for m in _CITED.finditer(text)]
    found = []
    for numbers, link in quotes:
        report = (page.parent / link).resolve()
        told = re.sub(
            r"\([\d.]+ ?- ?[\d.]+\)", "", report.read_text() if report.is_file() else ""
        )  # no intervals
        sections = re.split(r"^## ", told, flags=re.M)
        missing = [
            [n for n in numbers if not re.search(rf"(?<![\d.]){re.escape(n)}(?![\d]|\.\d)", section)]
            for section in sections
        ]
        least = min(missing, key=len)
        if least:
            found.append(f"{link} does not say {', '.join(least)} in one section")
    return found


@cache
def numerals(path: Path) -> frozenset[float]:
    text = path.read_text() if path.is_file() else ""
    found = re.findall(r"(?<![\w.])\d[\d']*(?:\.\d+)?(?:e-?\d+)?", text)
    return frozenset(float(number.replace("'", "")) for number in found)


def wrong_constants(page: Path, text: str) -> list[str]:
    """Numbers in a link to a source, `[12 mrad](x.hpp)`, stand in it: as they are, or in SI."""
    found = []
    for said, link in _SOURCE_NUMBER.findall(text):
        there = numerals((page.parent / link).resolve())
        for number, unit in re.findall(r"(?<![\w.])(\d+(?:\.\d+)?)(?![\w.]) ?(%|m(?=rad))?", said):
            si = float(number) * {"%": 0.01, "m": 0.001}.get(unit, 1.0)
            if not any(math.isclose(si, other) for other in there):
                found.append(f"{link} does not have {number}{unit and ' ' + unit}")
    return found


@cache
def words_of_code(root: Path) -> frozenset[str]:
    files = tree_of_git(root).ending(".py", ".cpp", ".hpp")
    ours = [name for name in files if name.startswith(("python/", "examples/", "src/"))]
    return frozenset(re.findall(r"\w+", " ".join((root / name).read_text() for name in ours)))


def wrong_names(root: Path, text: str) -> list[str]:
    """Attributes in Python blocks: of our code, pandas or Matplotlib."""
    blocks = "".join(re.findall(r"```python\n(.*?)```", text, re.S))
    names = re.findall(r"\.([a-z]\w+)", re.sub(r"#.*|\"[^\"\n]*\"", "", blocks))
    others = {"groupby", "describe", "plot", "figure", "savefig"}
    return [f"no name .{name}" for name in names if name not in others | words_of_code(root)]


def complaints(root: Path, page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    found = []
    for number, code in code_of(text):
        wrong = wrong_keys(code) + wrong_paths(root, page, code)
        for said in commands_of(code):
            wrong += wrong_options(root, said)
        found += [f"{page.name}:{number}: {what}" for what in wrong]
    whole = wrong_lines(root, text) + wrong_tests(root, text) + wrong_names(root, text)
    whole += wrong_quotes(page, text) + wrong_constants(page, text)
    return found + [f"{page.name}: {what}" for what in whole]


def test_what_pages_name_exists(root):
    found = []
    for name in pages(tree_of_git(root)):
        if name != "CHANGELOG.md":
            found += complaints(root, root / name)
    assert found == []


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("`equipoise sim --yaw-rate 3`", "has no --yaw-rate"),
        ("```sh\n./tools/campaign --robot-count 3\n```", "has no --robot-count"),
        ("`equipoise simulate --log x`", "no command equipoise simulate"),
        ("set `safety.max_lean_rad` lower", "no configuration key safety.max_lean_rad"),
        ("see `config/robot.toml`", "no file config/robot.toml"),
        ("see `test_nothing_at_all.py`", "no file test_nothing_at_all.py"),
        ("run `./tools/campaign\n  --robotz 3`", "has no --robotz"),
        ("at src/app/main.cpp:99999", "no line src/app/main.cpp:99999"),
        ("```python\nrun.log.sensor_table()\n```", "no name .sensor_table"),
        ("at CMakeLists.txt:99999", "no line CMakeLists.txt:99999"),
        ("it falls in 0.7 s, [control](experiments/control.md)", "does not say 0.7"),
        ("`test_links.py::test_that_is_not_there`", "no test test_links.py::test_that_is_not_there"),
        ("[0.00777 rad](reports/as-built.md)", "does not say 0.00777"),
        ("- Of 987 robots all stood\n  ([report](reports/as-built.md)).", "does not say 987"),
        ("| robots | 77.7 % of 1000 ([report](reports/as-built.md)) |", "does not say 77.7"),
        ("| bound | [18.7 nats](../include/equipoise/estimate/sensor_faults.hpp) |", "does not have 18.7"),
        ("[13 mrad](../src/robots/mbbr/estimators.cpp)", "does not have 13 m"),
        (
            "`equipoise sim --yaw-hz 3`, `safety.max_tilt_rad`, `config/mbbr.toml`, CMakeLists.txt:1\n"
            "[0.0076 rad](reports/as-built.md) [12 mrad](../src/robots/mbbr/estimators.cpp) "
            "`test_links.py::test_every_link_leads_somewhere`",
            None,
        ),
    ],
)
def test_a_wrong_name_is_found(root, tmp_path, line, complaint):
    (tmp_path / "docs").mkdir()
    for folder in ("docs/reports", "docs/experiments", "include", "src"):
        (tmp_path / folder).symlink_to(root / folder)
    page = tmp_path / "docs/page.md"
    page.write_text(f"# Page\n{line}\n")
    found = complaints(root, page)
    assert (len(found) == 1 and complaint in found[0]) if complaint else found == []


def test_pages_use_the_words_of_the_glossary(root):
    assert [str(finding) for finding in words(tree_of_git(root))] == []


def usages(root) -> dict[str, str]:
    """Help of the commands, and the text that each script in tools/ prints for --help."""
    man = [root / "build/host/equipoise", "man", "--to", "markdown"]
    found = {"equipoise": subprocess.run(man, capture_output=True, text=True, check=True).stdout}
    for script in (path for path in (root / "tools").iterdir() if path.is_file() and not path.suffix):
        found[script.name] = "\n".join(
            re.findall(r"<<'?TEXT'?\n(.*?)^TEXT$", script.read_text(), re.S | re.M)
        )
    return found


def test_help_uses_the_words_of_the_glossary(root):
    found = []
    for name, text in usages(root).items():
        for pattern, instead in TERMS:
            found += [
                f"{name}: {m[0]}; write: {instead}"
                for m in pattern.finditer(text)
                if m[0] not in ("mip", "Mip")
            ]
    assert found == []


def test_an_old_word_is_found(tmp_path):
    from equipoise_tools.lint.tree import Tree

    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/page.md").write_text("# A page\nThe gyro lies.\nA tilt, `as printed` in code, a run.\n")
    found = words(Tree(tmp_path, ["docs/page.md"]))
    assert [(f.line, "faulty" in str(f)) for f in found] == [(2, True)]


def test_reports_say_their_commit_and_date(root):
    measured = [file for file in (root / "docs/reports").glob("*.md") if file.name != "parts.md"]  # no runs
    for file in [*measured, *(root / "docs/experiments").glob("[a-z]*.md")]:
        text = file.read_text(encoding="utf-8")
        parts = re.split(r"^(?=## )", text, flags=re.M)[1:] if file.stem == "as-built" else [text]
        for part in parts:
            head = "\n".join(part.splitlines()[:14])
            assert re.search(r"\b[0-9a-f]{7,}(-dirty)?, 20\d\d-\d\d-\d\d", head), (file.name, head[:200])


def test_hand_written_pages_are_at_most_thirty_thousand_words(root):
    names = [name for name in pages(tree_of_git(root)) if name != "docs/performance.md"]  # generated
    assert sum(len((root / name).read_text(encoding="utf-8").split()) for name in names) <= 30000


def cited_by(root: Path, shown: str) -> str:
    """Text of the reports and tests that a cell names."""
    files = [root / "docs" / name for name in re.findall(r"\((experiments/[\w.]+)\)", shown)]
    tests = [file for kind in ("*.py", "*.cpp") for file in sorted((root / "tests").rglob(kind))]
    names = re.findall(r"[\w/]+\.(?:py|cpp)|(?<=[`:])\w+(?=`)", shown)
    for name in names:
        is_test = re.compile(rf"def {name}\(|TEST\w*\(\w+, {name}\)")
        files += [f for f in tests if str(f).endswith(f"/{name}") or is_test.search(f.read_text())]
    return "\n".join(file.read_text() for file in files)


def errata_without_source(root: Path, text: str) -> list[str]:
    """Numbers of the right form, and of how it was found, stand in what shows them or are [T]'s."""
    published, found, shown = (root / "config/published.toml").read_text(), [], ""
    for line in text.splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) != 5 or cells[4] in ("shown by", "---"):
            continue
        shown = shown if cells[4] == "the same" else cited_by(root, cells[4])
        there = re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?:e-?\d+)?", "\n".join((shown, published, cells[1])))
        places = r"\((?:A\.)?\d\.?\d*\)|Tables? [\d.]+(?:, \d\.\d)*|Fig\. [\d.]+"
        said = re.sub(places, " ", " ".join(cells[2:4]))
        for number in re.findall(r"(?<![\w.\[])\d+(?:\.\d+)?(?!\w)", said):
            half = 0.5000001 * 10.0 ** -len(number.partition(".")[2])
            share = 0.01 if f"{number} %" in said else 1.0
            if not any(abs(float(other) - share * float(number)) <= share * half for other in there):
                found.append(f"{cells[0]}: {number}")
    return found


def test_numbers_of_the_errata_stand_in_what_shows_them(root):
    text = (root / "docs/errata.md").read_text()
    assert errata_without_source(root, text) == []
    planted = text.replace("(1.002 with plus)", "(1.777 with plus)")
    assert errata_without_source(root, planted) == ["(6.29): 1.777"]
