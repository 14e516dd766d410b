"""tools/run and tools/test install only what is missing, and say clearly when they cannot."""

import os
import subprocess
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parents[2] / "tools"

FAKES = {
    # Everything is installed but what MISSING lists.
    "dpkg-query": 'case " $MISSING " in *" $3 "*) exit 1 ;; esac; echo installed',
    "dpkg": '[ "$1" = --print-architecture ] && echo amd64; exit 0',
    # Writes real calls down. NO_LISTS: knows no package until updated; OLD_LISTS: cannot fetch any.
    "apt-get": """
if [ -n "$LOCKED" ] && [ ! -e "$CALLS.waited" ]; then
  case " $* " in *" --simulate "*) exit ;; esac
  echo "E: Could not get lock /var/lib/dpkg/lock-frontend. It is held by process 1 (apt)"
  exit 100
fi
words=
for word; do case $word in -* | *::*) ;; *) words="$words $word" ;; esac; done
case " $* " in *" --simulate "*) [ -z "$NO_LISTS" ] || [ -e "$CALLS.updated" ]; exit ;; esac
echo "$words" >>"$CALLS"
case $words in
" update") touch "$CALLS.updated" ;;
*) [ -z "$OLD_LISTS" ] || [ -e "$CALLS.updated" ] ;;
esac""",
    "sleep": 'touch "$CALLS.waited"',
    "cmake": """
case "$*" in
"--preset "*) mkdir -p "build/$2"; echo "CMAKE_HOME_DIRECTORY:INTERNAL=$PWD" >"build/$2/CMakeCache.txt"
  touch "build/$2/build.ninja" ;;
esac
echo " cmake $*" >>"$CALLS"
""",
    "id": 'echo "${FAKE_UID:-0}"',
    "sudo": 'echo " sudo" >>"$CALLS"; exec "$@"',
}


@pytest.fixture
def machine(tmp_path, root):
    """A copy of the set-up in a tree of its own, on a machine made of fakes."""
    lib = tmp_path / "tree" / "tools" / "lib"
    lib.mkdir(parents=True)
    (tmp_path / "tree" / "build").mkdir()
    (lib / "setup.sh").write_text((root / "tools/lib/setup.sh").read_text())
    (lib.parent / "packages.txt").write_text(
        "# note\n[host]  # why\ncmake\nninja-build  # fast\n\n[test]\nshellcheck\n"
    )
    programs = tmp_path / "bin"
    programs.mkdir()
    calls = tmp_path / "calls"

    def run(groups="host test", without=(), script="", **environment):
        for name, body in FAKES.items():
            if name not in without:
                (programs / name).write_text(f"#!/bin/sh\n{body}\n")
                (programs / name).chmod(0o755)
        tools = ("awk", "bash", "cat", "dirname", "env", "grep", "mkdir", "nproc", "rm", "sh", "tee", "touch")
        for name in (*tools, "mv"):
            (programs / name).unlink(missing_ok=True)
            (programs / name).symlink_to(
                next(p for p in (f"/usr/bin/{name}", f"/bin/{name}") if os.path.exists(p))
            )
        calls.write_text("")
        defaults = {"MISSING": "", "NO_LISTS": "", "OLD_LISTS": "", "LOCKED": "", "FAKE_UID": "0"}
        result = subprocess.run(
            [programs / "bash", "-c", f"source {lib}/setup.sh; {script or 'install_packages ' + groups}"],
            env={"PATH": str(programs), "CALLS": str(calls), **defaults, **environment},
            capture_output=True,
            text=True,
        )
        return result, calls.read_text().splitlines()

    return run


def test_nothing_missing_means_apt_is_not_called(machine):
    result, calls = machine()
    assert (result.returncode, calls, result.stderr) == (0, [], "")


def test_only_what_is_missing_is_installed_without_new_lists(machine):
    result, calls = machine(MISSING="ninja-build shellcheck")
    assert result.returncode == 0, result.stderr
    assert calls == [" install ninja-build shellcheck"]


def test_only_the_asked_groups_are_looked_at(machine):
    _, calls = machine(groups="host", MISSING="ninja-build shellcheck")
    assert calls == [" install ninja-build"]


@pytest.mark.parametrize("lists", ["NO_LISTS", "OLD_LISTS"])
def test_package_lists_are_refreshed_when_they_do_not_serve(machine, lists):
    result, calls = machine(MISSING="cmake", **{lists: "yes"})
    assert result.returncode == 0, result.stderr
    assert calls[-2:] == [" update", " install cmake"]


def test_another_installation_is_waited_for_and_said(machine):
    result, calls = machine(MISSING="cmake", LOCKED="yes")
    assert result.returncode == 0, result.stderr
    assert calls == [" install cmake"]
    assert result.stderr.count("another program is installing packages; waiting") == 1


def test_a_failure_that_is_no_lock_is_not_waited_for(machine):
    result, _ = machine(script="when_unlocked sh -c 'echo no such package; exit 100'")
    assert result.returncode != 0
    assert "waiting" not in result.stderr


def test_a_build_folder_of_another_tree_is_made_anew(machine, tmp_path):
    tree, calls = tmp_path / "tree", [" cmake --preset host", " cmake --build build/host"]
    build = "build host"
    (tree / "CMakePresets.json").write_text("{}")
    _, first = machine(script=build)
    assert [call.split(" -j")[0] for call in first] == calls
    (tree / "build/host/equipoise").write_text("program")
    _, second = machine(script=build)
    assert len(second) == 1  # built, not configured again
    assert (tree / "build/host/equipoise").exists()
    cache = tree / "build/host/CMakeCache.txt"
    cache.write_text(cache.read_text().replace(str(tree), "/somewhere/else"))
    result, third = machine(script=build)
    assert [call.split(" -j")[0] for call in third] == calls
    assert "build/host was made for another folder" in result.stderr
    assert not (tree / "build/host/equipoise").exists()


def test_package_lists_of_another_tree_are_fetched_anew(machine, tmp_path, root):
    lists = tmp_path / "tree/build/apt/bookworm-armhf"
    lists.mkdir(parents=True)
    (lists / "apt.conf").write_text('Dir::State "/somewhere/else/build/apt/bookworm-armhf";\n')
    source = f"source {root}/tools/lib/foreign_apt.sh; machine_mirror() {{ echo mirror; }}; "
    for update in ([" update"], []):
        result, calls = machine(script=source + "foreign_apt armhf bookworm install x")
        assert result.returncode == 0, result.stderr
        assert calls == [*update, " install x"]
    assert "somewhere" not in (lists / "apt.conf").read_text()


BESIDE = """
ensure_python() { %s; }
install_packages() { echo "packages $*" >>"$CALLS"; %s; }
flock() { :; }
setup host test
echo built >>"$CALLS"
"""


def test_python_is_set_up_beside_the_packages_that_it_does_not_need(machine, tmp_path):
    meet = f'until [ -e "{tmp_path}/python" ]; do :; done'
    python = f'echo python >>"$CALLS"; touch "{tmp_path}/python"'
    result, calls = machine(script=BESIDE % (python, f'[ "$*" = host ] || {{ {meet}; }}'))
    assert result.returncode == 0, result.stderr
    assert calls[0] == "packages host" and calls[-1] == "built"
    assert set(calls[1:-1]) == {"python", "packages host test"}


def test_a_failure_beside_the_packages_ends_the_set_up(machine):
    result, calls = machine(script=BESIDE % ('die "no pip"', ":"))
    assert result.returncode == 1
    assert result.stderr == "error: no pip\n"
    assert "built" not in calls


@pytest.mark.parametrize("end", ['die "no apt"', "kill -TERM $$"])
def test_what_runs_beside_ends_with_the_set_up(machine, tmp_path, end):
    """Its output is ours: the call returns when both have ended. TERM: in the background INT is ignored."""
    python = f'touch "{tmp_path}/python"; /usr/bin/sleep 60; echo late >>"$CALLS"'
    wait = f'[ "$*" = host ] || {{ until [ -e "{tmp_path}/python" ]; do :; done; {end}; }}'
    result, calls = machine(script=BESIDE % (python, wait))
    assert result.returncode in (1, 143)
    assert "late" not in calls and "built" not in calls


VENV = """#!/bin/sh
case "$*" in
*" config list") printf "%b" "$PIP_SETTINGS" ;;
*" uv pip install "*)
  [ -z "$UV_FAILS" ] || exit 2
  echo "uv index=$UV_DEFAULT_INDEX cert=$SSL_CERT_FILE" >>"$CALLS"
  ;;
*" install --quiet uv=="*) [ -z "$NO_UV" ] ;;
*) echo "pip" >>"$CALLS" ;;
esac
"""


@pytest.mark.parametrize(
    ("environment", "by"),
    [
        ({}, "uv index= cert="),
        (
            {"PIP_SETTINGS": "global.index-url='one'\n:env:.cert='/c.pem'\n"},
            "uv index=one cert=/c.pem",
        ),
        ({"PIP_SETTINGS": "global.proxy='p'\n"}, "pip"),  # uv would go elsewhere
        ({"PIP_SETTINGS": "global.index-url='one'\n:env:.index-url='two'\n"}, "pip"),  # which?
        ({"NO_UV": "yes"}, "pip"),
        ({"UV_FAILS": "yes"}, "pip"),
    ],
)
def test_uv_installs_from_where_pip_would_else_pip_does(machine, tmp_path, environment, by):
    python = tmp_path / "tree/build/venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(VENV)
    python.chmod(0o755)
    defaults = {"PIP_SETTINGS": "", "NO_UV": "", "UV_FAILS": "", "UV_DEFAULT_INDEX": "", "SSL_CERT_FILE": ""}
    result, calls = machine(script="install_python list.txt", **(defaults | environment))
    assert result.returncode == 0, result.stderr
    assert calls == [by]
    assert (result.stderr == "") == (by != "pip")


def test_an_ordinary_user_installs_through_sudo(machine):
    _, calls = machine(MISSING="cmake", FAKE_UID="1000")
    assert calls[-1] == " install cmake"
    assert " sudo" in calls


def test_an_ordinary_user_without_sudo_is_told_what_to_run(machine):
    result, calls = machine(MISSING="cmake", FAKE_UID="1000", without=["sudo"])
    assert result.returncode == 1
    assert calls == []
    assert "as root: apt-get install cmake" in result.stderr


def test_another_system_is_told_what_to_install(machine):
    result, _ = machine(without=["apt-get"])
    assert result.returncode == 1
    assert result.stderr == (
        "error: this is not a Debian system; install by hand what tools/packages.txt lists\n"
    )


COMMANDS = [
    *(path.name for path in TOOLS.iterdir() if path.is_file() and os.access(path, os.X_OK)),
    "lib/multicast",
]


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_every_command_has_help(root, tmp_path, command):
    """At once: nothing is installed or built for it."""
    for tool in ("cmake", "apt-get"):
        (tmp_path / tool).write_text("#!/bin/sh\necho ran >&2\nexit 1\n")
        (tmp_path / tool).chmod(0o755)
    path = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    result = subprocess.run(
        [root / "tools" / command, "--help"], capture_output=True, text=True, env=os.environ | path
    )
    assert result.returncode == 0
    assert "usage:" in result.stdout
    assert result.stderr == ""


@pytest.mark.parametrize(
    "arguments", [["--no-such"], ["--jobs"], ["--jobs", "0"], ["--jobs", "many"], ["--preset", "other"]]
)
def test_wrong_usage_of_the_test_command_is_one_line_and_status_2(root, arguments):
    result = subprocess.run([root / "tools/test", *arguments], capture_output=True, text=True)
    assert result.returncode == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("error: ")
