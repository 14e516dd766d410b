"""The checks on our own tree, and proof that each of them bites."""

import json
from pathlib import Path

import pytest
from equipoise_tools.lint import analyzers, formatting, house, law, tidy, words
from equipoise_tools.lint.tree import Tree, tree_of_folder, tree_of_git


def planted(folder: Path, **files: str) -> Tree:
    """A tree with these files; `__` in a keyword stands for `/`, the last `_` for the dot."""
    for key, text in files.items():
        name = ".".join(key.replace("__", "/").rsplit("_", 1))
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tree_of_folder(folder)


def listing(findings) -> str:
    return "\n".join(map(str, findings))


@pytest.fixture(scope="module")
def tree(root) -> Tree:
    return tree_of_git(root)


@pytest.mark.parametrize(
    "check", [formatting.clang_format, formatting.black, formatting.ruff, formatting.shellcheck]
)
def test_our_files_pass(tree, check):
    findings = check(tree)
    assert not findings, listing(findings)


def test_our_tree_keeps_the_dependency_law(tree):
    assert not (findings := law.law(tree)), listing(findings)


def test_our_tree_keeps_the_house_rules(tree):
    assert not (findings := house.house(tree)), listing(findings)


@pytest.mark.slow
def test_our_sources_pass_clang_tidy(tree):
    assert not (findings := tidy.clang_tidy(tree)), listing(findings)


def test_our_drivers_pass_the_compilers_analyzer(tree):
    assert not (findings := analyzers.gcc_analyzer(tree)), listing(findings)


@pytest.mark.slow
def test_our_sources_pass_cppcheck(tree):
    assert not (findings := analyzers.cppcheck(tree)), listing(findings)


def test_the_analyzers_find_a_second_free(tmp_path):
    tree = planted(
        tmp_path, drivers__a_c="#include <stdlib.h>\nvoid f(char* p) {\n  free(p);\n  free(p);\n}\n"
    )
    assert [(f.path, f.line) for f in analyzers.gcc_analyzer(tree)] == [("drivers/a.c", 4)]
    assert [(f.path, f.line) for f in analyzers.cppcheck(tree)] == [("drivers/a.c", 4)]


def test_the_checks_see_our_files(tree):
    assert "drivers/robot_io.h" in tree.ending(".h")
    assert {"tools/run", "tools/test", "tools/lib/setup.sh", ".ci/run"} <= set(tree.shell_scripts())
    assert "tools/equipoise_tools/lint/law.py" in tree.ending(".py")


def test_formatters_name_a_badly_formatted_file(tmp_path):
    tree = planted(
        tmp_path, src__a_cpp="int  f( ) { return 1 ; }\n", b_py="x = {  1:2 }\nimport os\n", c_sh="echo $1\n"
    )
    assert [f.path for f in formatting.clang_format(tree)] == ["src/a.cpp"]
    assert [f.path for f in formatting.black(tree)] == ["b.py"]
    assert {f.path for f in formatting.ruff(tree)} == {"b.py"}
    assert {f.path for f in formatting.shellcheck(tree)} == {"c.sh"}


def test_generated_files_are_not_formatted(tmp_path):
    assert not formatting.clang_format(planted(tmp_path, config__generated__gains_hpp="int  f( ) ;\n"))


STAGE = "include__equipoise__estimate__ekf_hpp"


@pytest.mark.parametrize(
    "header",
    [
        "<unistd.h>",
        "<sys/mman.h>",
        "<linux/i2c.h>",
        "<thread>",
        "<mutex>",
        "<iostream>",
        "<chrono>",
        "<lcm/lcm-cpp.hpp>",
    ],
)
@pytest.mark.parametrize("name", [STAGE, "src__plant__world_cpp", "include__equipoise__robots__mip_hpp"])
def test_law_keeps_the_operating_system_out_of_core(tmp_path, name, header):
    findings = law.law(planted(tmp_path, **{name: f"// x\n#include <array>\n#include {header}\n"}))
    assert [f.line for f in findings] == [3]


@pytest.mark.parametrize(
    "header",
    [
        "equipoise/types.hpp",
        "equipoise/samples.hpp",
        "equipoise/config.hpp",
        "equipoise/estimate/joseph.hpp",
    ],
)
def test_law_lets_a_stage_know_values_and_its_own_room(tmp_path, header):
    assert not law.law(planted(tmp_path, **{STAGE: f'#include <Eigen/Core>\n#include "{header}"\n'}))


@pytest.mark.parametrize(
    "header",
    [
        "equipoise/control/slc.hpp",
        "equipoise/plant/world.hpp",
        "robots/mbbr/mbbr.hpp",
        "generated/mbbr_model.hpp",
    ],
)
def test_law_keeps_other_rooms_out_of_a_stage(tmp_path, header):
    findings = law.law(planted(tmp_path, **{STAGE: f'#include "{header}"\n'}))
    assert [(f.path, f.line) for f in findings] == [("include/equipoise/estimate/ekf.hpp", 1)]


def test_law_lets_only_the_pipeline_join_stages(tmp_path):
    both = '#include "equipoise/sense/calibrate.hpp"\n#include "equipoise/control/slc.hpp"\n'
    tree = planted(
        tmp_path, include__equipoise__pipeline_hpp=both, include__equipoise__runtime__loop_hpp=both
    )
    assert [(f.path, f.line) for f in law.law(tree)] == [("include/equipoise/runtime/loop.hpp", 2)]


def test_law_lets_only_the_application_join_core_and_drivers(tmp_path):
    driver = '#include "mpu9250.h"\n'
    tree = planted(
        tmp_path,
        drivers__mpu9250_h="",
        src__app__board_cpp=driver,
        src__config__board_cpp=driver,
        src__plant__world_cpp=driver,
    )
    assert [f.path for f in law.law(tree)] == ["src/config/board.cpp", "src/plant/world.cpp"]


def test_law_lets_robots_be_told_apart_in_one_file(tmp_path):
    switch = 'if (config.robot == "mip") {\n} else if (config.robot == "mbbr") {\n}\n'
    tree = planted(
        tmp_path,
        src__app__sim_cpp=switch,
        src__app__walk_cpp="switch (robot) {\n",
        src__plant__world_cpp="// if (robot == 1)\nif (a) go(robot);\nif (robot_kind() != 2) {}\n",
    )
    assert [(f.path, f.line) for f in law.law(tree)] == [
        ("src/app/walk.cpp", 1),
        ("src/plant/world.cpp", 3),
    ]


def test_law_lets_only_the_loop_call_a_tick(tmp_path):
    call = "// p.tick(raw)\nconst auto result = p.tick(raw, command, clock);\n"
    tree = planted(
        tmp_path,
        include__equipoise__runtime__loop_hpp=call,
        src__app__log__replay_hpp=call,
        tests__unit__a_test_cpp="wait_tick(&now);\npipeline->tick(raw);\n",
    )
    assert {(f.path, f.line) for f in law.law(tree)} == {
        ("src/app/log/replay.hpp", 2),
        ("tests/unit/a_test.cpp", 2),
    }


def test_law_keeps_modules_of_the_application_free_of_cycles(tmp_path):
    tree = planted(
        tmp_path,
        src__app__run__run_cpp='#include "app/trial/path.hpp"\n',
        src__app__trial__path_cpp='#include "app/io/world.hpp"\n#include "app/text/json.hpp"\n',
        src__app__io__world_cpp='#include "app/text/json.hpp"\n#include "app/run/run.hpp"\n',
        src__app__log__log_cpp='#include "app/run/run.hpp"\n',
    )
    assert {(f.path, f.line) for f in law.law(tree)} == {
        ("src/app/run/run.cpp", 1),
        ("src/app/trial/path.cpp", 1),
        ("src/app/io/world.cpp", 2),
    }


@pytest.mark.parametrize(
    "text",
    # Put together here, so that this file does not hold what it forbids.
    [
        "see /" + "work/main",
        "cd '/" + "root'",
        "pip --index" + "-url https://x",
        "shared" + "/thesis",
        "// TO" + "DO later",
    ],
)
def test_house_finds_what_must_not_be_tracked(tmp_path, text):
    findings = house.forbidden_words(planted(tmp_path, docs__a_md="line\n" + text + "\n"))
    assert [(f.path, f.line) for f in findings] == [("docs/a.md", 2)]


def test_house_allows_ordinary_text(tmp_path):
    assert not house.forbidden_words(
        planted(tmp_path, a_md="the network/work of a root/child, ${x}/workspace")
    )


def test_words_finds_old_terms_in_pages_comments_and_identifiers(tmp_path):
    tree = planted(
        tmp_path,
        docs__a_md="line\nafter a flight\n",
        src__a_cpp="int x;\n// of a flight\n",
        include__a_hpp="void beginFlight();\nint flight_s;\n",
        drivers__a_c='/* a run */ char key[] = "flights";\n',
        src__generated__a_cpp="// of a flight\n",
        tests__a_test_py="def test_a_flight():\n",
        src__b_cpp='int leans;\nask("stand it up, hands off");\nstatic_assert(a, "make room for it");\n',
    )
    found = {(f.path, f.line) for f in words.words(tree)}
    assert found == {
        ("docs/a.md", 2),
        ("src/a.cpp", 2),
        ("include/a.hpp", 1),
        ("include/a.hpp", 2),
        ("tests/a_test.py", 1),
        ("src/b.cpp", 2),
    }


def test_house_wants_headers_to_open_with_a_short_comment(tmp_path):
    tree = planted(
        tmp_path,
        include__equipoise__good_hpp="// what\n// in -> out\n#pragma once\n",
        include__equipoise__bare_hpp="#pragma once\n",
        drivers__long_h="/* 1\n" + " * x\n" * 8 + " */\n",
    )
    found = {f.path: f.message for f in house.headers_open_with_a_comment(tree)}
    assert set(found) == {"include/equipoise/bare.hpp", "drivers/long.h"}
    assert "opens with 10 lines" in found["drivers/long.h"]


def test_house_wants_short_files(tmp_path):
    tree = planted(
        tmp_path, src__long_cpp="x\n" * 401, src__fits_cpp="x\n" * 400, config__generated__m_hpp="x\n" * 999
    )
    assert [f.path for f in house.short_files(tree)] == ["src/long.cpp"]


def test_house_wants_few_templates_above_the_tick(tmp_path):
    parts = {f"src__app__{i}_hpp": "template <class T>\n" for i in range(house.MOST_TEMPLATES)}
    assert not house.plain_above_the_tick(planted(tmp_path, src__plant__a_hpp="template <int N>\n", **parts))
    tree = planted(tmp_path, src__runtime__b_cpp="  template <class T>\n", **parts)
    assert [f.path.split("/")[0] for f in house.plain_above_the_tick(tree)] == ["src"]


def test_house_wants_a_small_tree_and_each_picture_once(tmp_path, monkeypatch):
    tree = planted(tmp_path, a_png="x" * 60, a_svg="x", b_svg="x" * 39)
    monkeypatch.setattr(house, "LARGEST_TREE", 100)
    assert [f.path for f in house.small_tree(tree)] == ["a.svg"]
    monkeypatch.setattr(house, "LARGEST_TREE", 99)
    assert [f.path for f in house.small_tree(tree)] == ["a.svg", "a.png"]


class TestClangTidy:
    @pytest.fixture
    def project(self, tmp_path, root):
        (tmp_path / "build" / "host").mkdir(parents=True)
        (tmp_path / ".clang-tidy").write_text((root / ".clang-tidy").read_text())
        command = f"c++ -I{tmp_path}/include -o a.o -c {tmp_path}/src/a.cpp"
        (tmp_path / "build" / "host" / "compile_commands.json").write_text(
            f'[{{"directory": "{tmp_path}", "file": "src/a.cpp", "command": "{command}"}}]'
        )
        planted(tmp_path, include__equipoise__a_hpp="// a\ninline int a() { return 1; }\n")
        return tmp_path

    def test_it_finds_a_defect_and_remembers_only_a_pass(self, project):
        bad = '#include "equipoise/a.hpp"\nint f() {\n  int x;\n  return x + a();\n}\n'
        tree = planted(project, src__a_cpp=bad)
        findings = tidy.clang_tidy(tree)
        assert [(f.path, f.line) for f in findings if "init-variables" in f.message] == [("src/a.cpp", 3)]
        assert tidy.clang_tidy(tree) == findings
        tree = planted(project, src__a_cpp=bad.replace("int x;", "int x = 0;"))
        assert tidy.clang_tidy(tree) == []
        assert len(list((project / "build/host/tidy").iterdir())) == 1

    def test_files_compiled_as_one_unit_are_looked_at_and_analyzed_together(self, project):
        tree = planted(
            project,
            src__a_cpp="int a(const int* p) {\n  if (p == nullptr) return *p;\n  return 0;\n}\n",
            src__b_cpp='#include "b.hpp"\nint b() {\n  int x;\n  return x;\n}\n',
            src__b_hpp='#include "no.cpp"\n',
            src__no_cpp="",
        )
        unit = project / "build/host/Unity/unit.cxx"
        unit.parent.mkdir()
        unit.write_text(f'#include "{project}/src/a.cpp"\n#include "{project}/src/b.cpp"\n')
        entry = {"directory": str(unit.parent), "file": str(unit), "command": f"c++ -o u.o -c {unit}"}
        (project / "build/host/compile_commands.json").write_text(json.dumps([entry]))
        findings = [(f.path, f.line, f.message) for f in tidy.clang_tidy(tree)]
        assert any(p == "src/a.cpp" and n == 2 and "NullDereference" in m for p, n, m in findings)
        assert any(p == "src/b.cpp" and n == 3 and "init-variables" in m for p, n, m in findings)
        assert any(p == "src/b.hpp" and n == 1 and "suspicious-include" in m for p, n, m in findings)
        planted(project, src__a_cpp="int a() { return 1; }\n", src__b_cpp="int b() { return 2; }\n")
        assert tidy.clang_tidy(tree) == []

    def test_it_looks_again_when_a_header_changed(self, project):
        tree = planted(project, src__a_cpp='#include "equipoise/a.hpp"\nint f() { return a(); }\n')
        assert tidy.clang_tidy(tree) == []
        (before,) = (project / "build/host/tidy").iterdir()
        planted(project, include__equipoise__a_hpp="// a\ninline int a() { return 2; }\n")
        assert tidy.clang_tidy(tree) == []
        (after,) = (project / "build/host/tidy").iterdir()
        assert before.name != after.name
