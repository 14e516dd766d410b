"""What users have is not overwritten, and what is no file is not waited for."""

import os
import resource
import shutil
import subprocess

import equipoise
import pytest
from equipoise_robot import channels, design
from equipoise_robot.errors import UserError
from equipoise_robot.log import read_log
from equipoise_tools.view import open_source

import lcm

PATIENCE_S = 60
DEEP = '"\\""' + ".a" * 200_000 + " = 1\n"  # a key of so many tables, behind an escaped quote


@pytest.fixture
def log(do, root, tmp_path):
    config = str(root / "config/edumip.toml")
    do("sim", "--config", config, "--duration-s", "1", "--log", "x.lcm", status=0)
    return tmp_path / "x.lcm"


@pytest.fixture
def do(root, tmp_path):
    def run(*arguments, status):
        command = [root / "build/host/equipoise", *arguments]
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, timeout=PATIENCE_S, cwd=tmp_path
        )
        assert done.returncode == status, done.stderr
        return done.stderr

    return run


def test_a_log_is_not_converted_onto_itself(do, log, tmp_path):
    before = log.read_bytes()
    (tmp_path / "link.csv").symlink_to(log)
    shutil.copy(log, tmp_path / "y.csv")
    for arguments in (
        ["x.lcm", "--to", "csv", "--out", "x.lcm"],
        ["x.lcm", "--to", "mcap", "--out", "link.csv"],
        ["y.csv", "--to", "csv"],  # its default name
    ):
        assert "is the log itself" in do("convert", *arguments, status=2)
    assert "holds no csv" in do("convert", "x.lcm", "--to", "csv", "--out", "y.csv", status=2)
    assert log.read_bytes() == before and (tmp_path / "y.csv").read_bytes() == before


def test_a_result_replaces_only_its_own_kind(do, log, tmp_path):
    notes = tmp_path / "notes.md"
    notes.write_text("A winter's work\n")
    for kind, command in {
        "csv": ["convert", "x.lcm", "--to", "csv", "--out"],
        "mcap": ["convert", "x.lcm", "--to", "mcap", "--out"],
        "log": ["friction-rig", "--log"],
        "buttons of an app": ["remote", "learn", "--port", "/dev/null", "--out"],
    }.items():
        assert f"notes.md: exists and holds no {kind}" in do(*command, "notes.md", status=2)
    bench = ["motor-bench", "--motor", "1", "--driver", "1", "--pwm-hz", "10000", "--log"]
    assert "notes.md: exists and holds no log" in do(*bench, "notes.md", status=2)
    for _ in range(2):
        do("friction-rig", "--log", "rig.lcm", status=0)
        do("convert", "x.lcm", "--to", "csv", status=0)
        do("convert", "x.lcm", "--to", "mcap", status=0)
    assert notes.read_text() == "A winter's work\n"


def test_json_replaces_json_only(do, log, root, tmp_path):
    before = log.read_bytes()
    shutil.copy(root / "config/edumip.toml", tmp_path / "robot.toml")
    sim = ["sim", "--config", "robot.toml", "--duration-s", "1", "--log", "off", "--json"]
    assert "holds no JSON" in do("replay", "x.lcm", "--json", "x.lcm", status=2)
    assert "holds no JSON" in do(*sim, "robot.toml", status=2)
    (tmp_path / "blank.txt").write_text(100 * " " + "mine")
    assert "holds no JSON" in do(*sim, "blank.txt", status=2)
    for name, text in {
        "mine.toml": "[robot]\nname = 1\n",
        "essay.rtf": "{\\rtf1 It was}",
        "half": "[1, ",
    }.items():
        (tmp_path / name).write_text(text)
        assert "holds no JSON" in do(*sim, name, status=2)
        assert (tmp_path / name).read_text() == text
    assert log.read_bytes() == before
    (tmp_path / "out.json").write_text(" \n")
    do(*sim, "out.json", status=0)
    do(*sim, "out.json", status=0)


def test_half_a_json_is_not_left_in_the_way(do, root, tmp_path):
    config = root / "config/edumip.toml"
    command = ["sim", "--config", config, "--duration-s", "1", "--log", "off", "--json", "out.json"]
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        assert "out.json: cannot be written" in do(*command, status=2)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    do(*command, status=0)


@pytest.mark.parametrize(
    "command", [["sim", "--telemetry"], ["run", "--backend", "sim", "--command-url"], ["send", "--url"]]
)
def test_what_is_no_link(do, root, tmp_path, command):
    """A file would be replaced; a TCP server that goes would end a robot that balances."""
    kept = tmp_path / "kept.txt"
    kept.write_text("kept")
    more = ["--disarm"] if "send" in command else ["--config", root / "config/edumip.toml", "--duration-s", 1]
    assert "a file is no link" in do(*command, f"file://{kept}?mode=w", *more, status=2)
    assert "ends the program when its server does" in do(*command, "tcpq://127.0.0.1:1", *more, status=2)
    assert "names no link" in do(*command, "", *more, status=2)
    assert kept.read_text() == "kept"


def test_attaching_replaces_no_file(tmp_path):
    kept = tmp_path / "x.lcm"
    kept.write_bytes(b"mine")
    for url in (f"file://{kept}?mode=w", f"file://{kept}?mode=a"):
        with pytest.raises(UserError, match="might replace that file"):
            open_source(url)
    assert kept.read_bytes() == b"mine"
    with pytest.raises(UserError, match="when its server does"):
        open_source("tcpq://127.0.0.1:1")


def test_a_log_of_one_name_leaves_the_others(do, root, tmp_path, known_log):
    config = root / "config/edumip.toml"
    for name in ("x.20261122.lcm", "x.2024.lcm"):
        shutil.copy(known_log, tmp_path / name)
    (tmp_path / "essay.2024.txt").write_text("chapter 1")
    shutil.copy(config, tmp_path / "robot.toml")
    (tmp_path / "x.00001.lcm").write_text("stray")
    kept = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    sim = ["sim", "--config", str(config), "--duration-s", "1", "--log"]
    do(*sim, "x.lcm", status=0)
    do(*sim, "essay.txt", status=0)
    assert "exists and is no log" in do(*sim, "robot.toml", status=1)
    run = [
        "run",
        "--backend",
        "sim",
        "--fidelity",
        "nominal",
        "--telemetry",
        "off",
        "--config",
        str(config),
        "--duration-s",
        "1",
    ]
    assert "exists and is no log" in do(*run, "--log", "robot.toml", status=1)
    assert {name: (tmp_path / name).read_bytes() for name in kept} == kept


def test_an_earlier_log_of_the_same_name_is_kept(do, root, tmp_path):
    run = [
        "run",
        "--backend",
        "sim",
        "--fidelity",
        "nominal",
        "--telemetry",
        "off",
        "--speed",
        "100",
        "--duration-s",
        "1",
    ]
    for _ in range(2):
        do(*run, "--config", str(root / "config/edumip.toml"), "--log", "x.lcm", status=0)
    assert len(list(tmp_path.glob("x.*T*Z.lcm"))) == 1 and (tmp_path / "x.lcm").exists()


def test_a_log_that_is_deleted_during_its_run_is_no_success(root, tmp_path):
    command = [root / "build/host/equipoise", "run", "--config", root / "config/edumip.toml"]
    command += [
        "--backend",
        "sim",
        "--fidelity",
        "nominal",
        "--telemetry",
        "off",
        "--duration-s",
        "2",
        "--log",
        tmp_path / "x.lcm",
    ]
    with subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, text=True) as run:
        while not (tmp_path / "x.lcm").exists():
            assert run.poll() is None
        (tmp_path / "x.lcm").unlink()
        assert "was deleted while it was written" in run.stderr.read()
    assert run.returncode == 1


def test_a_name_that_is_not_utf8_has_its_result(root, tmp_path):
    name = os.path.join(os.fsencode(tmp_path), b"\xff.lcm")
    command = [
        root / "build/host/equipoise",
        "run",
        "--config",
        root / "config/edumip.toml",
        "--backend",
        "sim",
    ]
    command += [
        "--fidelity",
        "nominal",
        "--telemetry",
        "off",
        "--speed",
        "100",
        "--duration-s",
        "2",
        "--json",
        "-",
        "--log",
        name,
    ]
    done = subprocess.run(command, capture_output=True, timeout=PATIENCE_S)
    assert done.returncode == 0 and b'"ended": "finished"' in done.stdout


def test_nothing_waits_for_a_pipe(do, root, tmp_path):
    config = root / "config/edumip.toml"
    for name in ("pipe", "pipe.lcm"):
        os.mkfifo(tmp_path / name, 0o600)
    sim = ["sim", "--config", str(config), "--duration-s", "1", "--log"]
    assert "without a reader" in do(*sim, "off", "--json", "pipe", status=2)
    assert "no regular file" in do("model", "--robot", "mip", "--in", "pipe", "--json", "-", status=2)
    assert "is no file" in do("send", "--key", "pipe", "--arm", status=2)
    assert "no regular file" in do(*sim, "off", "--path", "pipe", status=2)
    assert "is a pipe" in do(*sim, "pipe.lcm", status=1)
    assert "is a pipe" in do("friction-rig", "--log", "pipe.lcm", status=2)
    for name in (tmp_path / "pipe.lcm", "/dev/zero"):
        with pytest.raises(UserError, match="is no regular file"):
            read_log(name)


def test_dots_without_end_are_refused(do, root, tmp_path):
    text = (root / "config/edumip.toml").read_text()
    (tmp_path / "deep.toml").write_text(DEEP + text)
    sim = ["sim", "--duration-s", "1", "--log", "off", "--config"]
    assert "dots in a line" in do(*sim, "deep.toml", status=2)
    with pytest.raises(UserError, match="dots in a line"):
        design(tmp_path / "deep.toml")


def test_nor_are_those_of_a_hostile_log(do, log, tmp_path):
    hostile = lcm.EventLog(str(tmp_path / "hostile.lcm"), "w")
    for event in lcm.EventLog(str(log)):
        data = event.data
        if event.channel == channels.RUN:
            message = equipoise.run_t.decode(data)
            message.config_toml = DEEP + message.config_toml
            data = message.encode()
        hostile.write_event(event.timestamp, event.channel, data)
    hostile.close()
    assert "dots in a line" in do("replay", "hostile.lcm", status=2)
    assert "dots in a line" in do("replay", "hostile.lcm", "--shadow", status=2)
    with pytest.raises(ValueError, match="dots in a line"):
        read_log(tmp_path / "hostile.lcm").sensors()


def test_what_a_terminal_would_obey_is_not_printed(do):
    assert "\x1b" not in do("sim", "--config", "\x1b]0;title\x07", status=2)
    assert "\x1b" not in do("sim\x1b[2J", status=2)
    told = do("sim", "--config", "gr\u00fcn\u009b2J", status=2)  # an escape of one character
    assert "\u009b" not in told and "gr\u00fcn??2J" in told


def test_too_few_descriptors_are_said_and_not_waited_for(root):
    command = f"ulimit -n 7; exec {root}/build/host/equipoise sim --config {root}/config/edumip.toml"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 2 and "only 7 files may be open" in done.stderr
