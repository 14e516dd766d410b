"""Shell completion, manual, did-you-mean, progress: what the command line says about itself."""

import json
import os
import pty
import re
import select
import shutil
import subprocess
import time

import pytest

pytestmark = pytest.mark.live


@pytest.fixture(scope="module")
def binary(root):
    return root / "build/host/equipoise"


def run(binary, *arguments, **more):
    return subprocess.run([binary, *map(str, arguments)], capture_output=True, text=True, check=False, **more)


@pytest.fixture(scope="module")
def helps(binary) -> dict[tuple[str, ...], str]:
    """Every command, found by its parent's help -> its help."""
    found = {}

    def visit(words):
        found[words] = text = run(binary, *words, "--help").stdout
        listed = text.split("\nSubcommands:\n")[1].split("\n\n")[0] if "\nSubcommands:\n" in text else ""
        for name in re.findall(r"^  (\S+)", listed, re.M):
            visit((*words, name))

    visit(())
    assert len(found) >= 28
    return found


def options_of(text: str) -> set[str]:
    return set(re.findall(r"(?:^  |,)(--[\w-]+)", text, re.M))


def test_every_command_has_a_working_example(helps):
    for words, text in helps.items():
        if words:
            example = re.search(r"^Example: .*equipoise (.*)", text, re.M)
            assert example, f"equipoise {' '.join(words)} --help shows no example"
            assert example[1].startswith(words[0])
            used = set(re.findall(r"--[\w-]+", example[1]))
            known = set().union(*(options_of(t) for w, t in helps.items() if w[:1] == words[:1]))
            assert used <= known, words


def test_helps_begin_alike(helps):
    for words, text in helps.items():
        assert text[0].isupper(), f"equipoise {' '.join(words)}: {text.splitlines()[0]}"


def test_every_option_has_the_range_and_the_default_of_the_table(root, helps):
    """A limit that moves is a change of behaviour: make it in tests/data/options.txt, too."""
    found = {
        " ".join([*words, *shown])
        for words, text in helps.items()
        for shown in re.findall(r"^  (?:-\w,)?(--\S+) \S+ in (\[.*?\])(=?\S*)", text, re.M)
    }
    table = {line.strip() for line in (root / "tests/data/options.txt").read_text().splitlines()}
    assert {" ".join(each.split()) for each in found} ^ table == set()


def test_every_command_and_option_is_in_the_manual(binary, helps, tmp_path):
    assert run(binary, "man", "--out", tmp_path).returncode == 0
    pages = {page.name: page.read_text().replace("\\-", "-") for page in tmp_path.iterdir()}
    assert len(pages) == len(helps)
    for words, text in helps.items():
        page = pages["-".join(["equipoise", *words]) + ".1"]
        shown = set(re.findall(r"\\fB(-[\w-]+)\\fR", page))
        assert options_of(text) <= shown, words
    markdown = run(binary, "man", "--to", "markdown").stdout
    for words, text in helps.items():
        if words:
            section = markdown.split(f"\n## equipoise {' '.join(words)}\n")[1].split("\n## ")[0]
            for option in options_of(text) if ("--help" in section) else ():
                assert f"`{option}" in section, (words, option)


def test_the_reference_explains_every_option_and_its_examples_have_what_is_required(binary):
    markdown = run(binary, "man", "--to", "markdown").stdout
    for section in markdown.split("\n## ")[1:]:
        example = section.split("```sh\n")[1].split("\n```")[0] if "```sh" in section else ""
        for names, text in re.findall(r"^\| `(.*?)`(?: \w+)? \| (.*) \|$", section, re.M):
            where = section.splitlines()[0], names
            assert re.match(r"(?!From [-\d]|Default:|Required|One of:|May be repeated)\S", text), where
            if re.search(r"\bRequired[.;]", text) and names.startswith("-"):
                assert any(name.split()[0] in example for name in names.split("`, `")), where
    assert re.search(r"`--robot TEXT` \| mbbr or mip\. Required; one of: mbbr, mip\. \|", markdown)


def test_manual_pages_are_clean_roff(binary, tmp_path):
    if shutil.which("groff") is None:
        pytest.skip("needs groff; lintian looks at the pages, too")
    run(binary, "man", "--out", tmp_path)
    for page in sorted(tmp_path.iterdir()):
        ended = subprocess.run(["groff", "-man", "-ww", "-z", page], capture_output=True, text=True)
        assert ended.stderr == "", page.name


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("sm", "sm is no command of equipoise; did you mean sim?"),
        ("config shwo", "shwo is no command of equipoise config; did you mean show?"),
        ("sim --drive-mp 1", "--drive-mp is no option of equipoise sim; did you mean --drive-mps?"),
        (
            "sim --yaw-hz=1 --fidelty=full",
            "--fidelty is no option of equipoise sim; did you mean --fidelity?",
        ),
        ("sim --zzzzzz", "--zzzzzz is no option of equipoise sim (equipoise sim --help"),
        ("sim", "--config is required (equipoise sim --help lists"),
        ("sim --config FILE --set friction.compensatoin=1", "did you mean friction.compensation?"),
        ("sim --config FILE --set compensation=1", "did you mean friction.compensation?"),
        ("sim --config FILE --set controller.thesis.gain[2].c1=1", "did you mean controller.thesis.gains?"),
        ("sim --config FILE --set controller.thesis.gains[2].c9=1", "no such key"),
        ("sim --config FILE --set controller.thesis.gains[99].c1=1", "gains has "),
        ("sim --config FILE --telemetry file:a.lcm", "a file is no link; --log FILE writes one"),
        ("run --config FILE --command-url tcpq://a", "ends the program when its server does; use udpm"),
        ("send --key FILE --url file:a.lcm --disarm", "a file is no link"),
    ],
)
def test_a_slip_is_named_in_one_line(binary, root, arguments, said):
    ended = run(binary, *arguments.replace("FILE", str(root / "config/mbbr.toml")).split())
    assert ended.returncode == 2
    assert said in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert ended.stdout == ""


def test_set_reaches_into_arrays(binary, root):
    config = root / "config/mbbr.toml"
    options = ["--config", config, "--set", "controller.thesis.gains[2].c1=0.125"]
    shown = run(binary, "config", "show", *options)
    assert shown.returncode == 0, shown.stderr
    assert "0.125" in shown.stdout
    assert "0.125" not in run(binary, "config", "show", "--config", config).stdout


COMPLETIONS = [
    ("equipoise si", {"sim"}),
    ("equipoise config sh", {"show"}),
    ("equipoise sim --fid", {"--fidelity"}),
    ("equipoise sim --fidelity th", {"thesis"}),
    ("equipoise convert run.lcm --to m", {"mcap"}),
    ("equipoise calibrate --zz", set()),
]


@pytest.fixture
def shells(binary, tmp_path):
    """Where shells find the program: the environment."""
    (tmp_path / "equipoise").symlink_to(binary)
    return {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "HOME": str(tmp_path)}


@pytest.mark.parametrize(("line", "wanted"), COMPLETIONS)
def test_bash_completes(shells, tmp_path, line, wanted):
    words = line.split(" ")
    program = f"""
source <(equipoise completion bash)
COMP_WORDS=({" ".join(words)}) COMP_CWORD={len(words) - 1} COMPREPLY=()
_equipoise
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    ended = subprocess.run(["bash", "-c", program], capture_output=True, text=True, cwd=tmp_path, env=shells)
    assert ended.stderr == ""
    assert set(ended.stdout.split()) == wanted


@pytest.mark.parametrize(("line", "wanted"), COMPLETIONS)
def test_fish_completes(shells, tmp_path, line, wanted):
    if shutil.which("fish") is None:
        pytest.skip("needs fish")
    program = f"equipoise completion fish | source; complete -C {line!r}"
    ended = subprocess.run(
        ["fish", "--no-config", "-c", program], capture_output=True, text=True, cwd=tmp_path, env=shells
    )
    assert ended.stderr == ""
    found = {offer.split("\t")[0] for offer in ended.stdout.splitlines()}
    assert found - {"run.lcm", "equipoise"} == wanted


@pytest.mark.parametrize(("line", "wanted"), COMPLETIONS)
def test_zsh_completes(binary, shells, tmp_path, line, wanted):
    if shutil.which("zsh") is None:
        pytest.skip("needs zsh")
    (tmp_path / "_equipoise").write_text(run(binary, "completion", "zsh").stdout)
    master, slave = pty.openpty()
    shell = subprocess.Popen(
        ["zsh", "-f", "-i"],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        cwd=tmp_path,
        env={**shells, "TERM": "dumb", "PS1": "", "COLUMNS": "200"},
        start_new_session=True,
    )
    os.close(slave)
    said = ""

    def until(mark):
        nonlocal said
        deadline = time.monotonic() + 60
        while mark not in said:
            assert time.monotonic() < deadline, said
            if select.select([master], [], [], 0.5)[0]:
                said += os.read(master, 65536).decode(errors="replace")

    setup = f"fpath=({tmp_path} $fpath); autoload -Uz compinit; compinit -u -d dump; LISTMAX=9999; "
    setup += "zstyle ':completion:*' menu no; bindkey '^I' complete-word; echo rea''dy"
    os.write(master, f"{setup}\n".encode())
    until("ready")
    said = said.split("ready")[-1]
    until("\x1b[?2004h")  # the line editor reads
    said = ""
    os.write(master, f"{line}\t\x15echo do''ne\n".encode())  # complete, clear the line, say so
    until("done")
    shell.kill()  # an interactive shell takes no notice of SIGTERM
    shell.wait()
    os.close(master)
    for word in wanted:
        assert f"{word} " in said
    if not wanted:
        assert "--config" not in said


def test_a_long_job_says_how_long_it_will_take(binary, root, tmp_path):
    trials = tmp_path / "trials.json"
    trials.write_text('{"trials": [' + ", ".join(['{"duration_s": 60, "fidelity": "built2025"}'] * 40) + "]}")
    arguments = [
        "trials",
        "--config",
        root / "config/mbbr.toml",
        "--in",
        trials,
        "--jobs",
        "1",
        "--json",
        "-",
    ]
    master, slave = pty.openpty()
    job = subprocess.Popen([binary, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=slave)
    os.close(slave)
    said = ""
    while job.poll() is None and " to go" not in said:
        if select.select([master], [], [], 1.0)[0]:
            said += os.read(master, 4096).decode()
    job.terminate()
    job.wait()
    os.close(master)
    assert re.search(r"trials: +\d+ %, (\d+ min )?\d+ s to go", said)


def test_nothing_is_drawn_where_nobody_looks(binary, root, tmp_path):
    design = run(binary, "design", "--config", root / "config/edumip.toml", "--json", "-")
    assert design.stderr == ""


def test_bench_measures_the_fewest_wakes_it_offers(binary, root):
    ended = run(binary, "bench", "--wakes", "10", "--json", "-", cwd=root)
    assert ended.returncode == 0, ended.stderr
    wake = json.loads(ended.stdout)["wake"]
    assert [wake[way]["wakes"] for way in ("loop", "clock_nanosleep")] == [10, 10]
    for way in wake.values():
        assert 0 <= way["p50_us"] <= way["p99_us"] <= way["max_us"]


@pytest.mark.parametrize("option", ["--fault", "--phase"])
def test_a_campaign_of_no_such_case_is_refused(binary, root, option):
    done = run(binary, "campaign", "--config", root / "config/mbbr.toml", option, "nonesuch")
    assert done.returncode == 2
    assert option in done.stderr
    assert "nonesuch" in done.stderr
