"""tools/mutation finds a planted survivor, kills a planted mutant, and goes on where it stopped."""

import json
import os

from equipoise_tools.mutation.__main__ import Campaign, drawn, kept, unseen
from equipoise_tools.mutation.bench import Worker
from equipoise_tools.mutation.generate import mutants
from equipoise_tools.mutation.page import write_page
from equipoise_tools.mutation.parts import PARTS, Part, Stage
from equipoise_tools.mutation.store import OLDER_TESTS, Store
from equipoise_tools.mutation.store import tests_of as state_of_tests

LIMIT = """#include "limit.h"
int limit(int x) {
  if (x > 10) return 10;
  return x;
}
"""
# Nobody asks at 11: to compare with 11 instead of 10 survives.
TEST = """extern "C" {
#include "limit.h"
}
int main() { return limit(5) == 5 && limit(50) == 10 ? 0 : 1; }
"""
NINJA = """
rule cc
  command = c++ -x $language -Idrivers -I../../drivers -O2 -c $in -o $out
rule link
  command = : && c++ $in -o $out limit.o && :
build limit.o: cc ../../drivers/limit.c
  language = c
build tests/drivers/CMakeFiles/own_tests.dir/limit_test.cpp.o: cc ../../tests/drivers/limit_test.cpp
  language = c++
build tests/drivers/own_tests: link tests/drivers/CMakeFiles/own_tests.dir/limit_test.cpp.o | limit.o
# of drivers/limit.c.o
"""
OWN = Part(("drivers/limit.c",), (Stage("tests/drivers/own_tests", ("drivers/limit_test.cpp",)),))


def project(root, folder):
    """A source, its test, and a build of both."""
    build = folder / "build" / "host"
    for place in (folder / "drivers", folder / "tests" / "drivers", build, folder / "tools" / "lib"):
        place.mkdir(parents=True)
    (folder / "tools/lib/multicast").symlink_to(root / "tools/lib/multicast")
    (folder / "drivers/limit.h").write_text("int limit(int x);\n")
    (folder / "drivers/limit.c").write_text(LIMIT)
    (folder / "tests/drivers/limit_test.cpp").write_text(TEST)
    (build / "build.ninja").write_text(NINJA)
    command = f"cc -I{folder}/drivers -O2 -o limit.o -c x"
    entry = {"directory": str(build), "file": f"{folder}/drivers/limit.c", "command": command}
    (build / "compile_commands.json").write_text(json.dumps([entry]))
    assert os.system(f"ninja -C {build} > {folder}/log") == 0, (folder / "log").read_text()


def outcomes(folder, work):
    (folder / work).mkdir()
    campaign = Campaign(folder, Store(folder / "results.jsonl"), 2, folder / work)
    return campaign.go("own", OWN, drawn(OWN, "own", folder, 0, 1))


def test_it_kills_what_tests_notice_and_finds_what_they_do_not(root, tmp_path, monkeypatch):
    project(root, tmp_path)
    told = outcomes(tmp_path, "first")
    fate = {(mutant.line, mutant.kind, mutant.change): outcome.status for *_, mutant, outcome in told}
    assert fate[(3, "condition", "x > 10 → !(x > 10)")] == "killed"
    assert fate[(3, "constant", "10 → 11")] in ("killed", "survived")  # two of them on the line
    by_place = {mutant.begin: outcome.status for *_, mutant, outcome in told if mutant.kind == "constant"}
    assert by_place == {LIMIT.index("10"): "survived", LIMIT.index("10;"): "killed"}
    # Equal for every x; what the compiler makes of it decides whether it counts.
    assert fate[(3, "relation", "> → >=")] in ("same_code", "survived")

    monkeypatch.setitem(PARTS, "own", OWN)
    page, unexplained = write_page({"own": told}, {}, 1, tmp_path)
    assert "drivers/limit.c:3 10 → 11   [if (x > 10) return 10;]" in unexplained
    assert "**none yet**" in page
    why = {("drivers/limit.c", "if (x > 10) return 10;", "10 → 11"): "nobody asks at 11"}
    page, unexplained = write_page({"own": told}, why, 1, tmp_path)
    assert "nobody asks at 11" in page and not [line for line in unexplained if "10 → 11" in line]
    survived = sum(outcome.status == "survived" for *_, outcome in told)
    assert f" | {survived} | 1 | " in page, "survivors, and those with a reason"

    # What is kept makes a page without judging; what never was measured is said to be so.
    store = Store(tmp_path / "results.jsonl")
    sample = drawn(OWN, "own", tmp_path, 0, 1)
    same, other = (kept(store, sample, tests) for tests in (state_of_tests(OWN, tmp_path), "of another day"))
    assert [outcome for *_, outcome in same] == [outcome for *_, outcome in told]
    assert {o.by for *_, o in other if o.status == "survived"} == {OLDER_TESTS}
    page, unexplained = write_page({"own": other}, {}, 1, tmp_path)
    assert "not tried since the tests changed" in page and not unexplained
    del store.lines[list(store.lines)[-1]]
    assert len(kept(store, sample, "")) < len(told)
    every = {("drivers/limit.c", "if (x > 10) return 10;", m.change): "the same" for *_, m, _ in told}
    page, _ = write_page({"own": [each for each in told if each[3].status == "survived"]}, every, 1, tmp_path)
    assert "not measured" in page and "the same" in page, "of what all do the same nothing is known"
    page, _ = write_page({"own": []}, {}, 1, tmp_path)
    assert f"| own | {len(told)} |  | 0 |  |  |  | not measured | 80 % | not measured |  |" in page

    # A sample for which tests were written is counted apart.
    learnt, fresh = drawn(OWN, "own", tmp_path, 3, 1), unseen(OWN, "own", tmp_path, 3, 2, [1], 3)
    assert len(fresh) == 1 and not {m for *_, m in learnt} & {m for *_, m in fresh}
    # A smaller new sample does not let go what the larger ones before had shown.
    assert unseen(OWN, "own", tmp_path, 1, 2, [1], 3) == fresh
    assert unseen(OWN, "own", tmp_path, 3, 2, [1]) == []
    # Of the second sample those count that were drawn without the first one's, and those of a plain draw.
    seconds = unseen(OWN, "own", tmp_path, 1, 2, [1], 1) + drawn(OWN, "own", tmp_path, 1, 2)
    third = unseen(OWN, "own", tmp_path, 4, 3, [1, 2], 1)
    assert third and not {m for *_, m in seconds + learnt[:1]} & {m for *_, m in third}
    page, _ = write_page({"own": told[3:]}, {}, 2, tmp_path, {("own", 1): told[:3]})
    tried = [o.status for *_, o in told[:3] if o.status != "same_code"]
    row = next(line for line in page.splitlines() if line.startswith("| own |"))
    assert f"| own | {len(told)} | 2 without 1 |" in row
    assert row.endswith(f"| {len(tried) - tried.count('survived')} of {len(tried)} |")

    # Not judged again they are named, and not counted.
    page, _ = write_page({"own": told[3:]}, {}, 2, tmp_path, {("own", 1): []})
    row = next(line for line in page.splitlines() if line.startswith("| own |"))
    assert "| 2 without 1 |" in row and row.endswith(" |  |")

    # A part that is not measured again keeps its row and its survivors, in the order of the parts.
    monkeypatch.delitem(PARTS, "drivers")  # it would have the same source
    monkeypatch.setitem(PARTS, "other", Part(("drivers/limit.h",), OWN.stages))
    both, _ = write_page({"own": told[3:], "other": []}, {}, 2, tmp_path, {("own", 1): []})
    again, _ = write_page({"other": []}, {}, 7, tmp_path, earlier=both)
    assert again == both

    # Nothing is built or run a second time; on better tests, what survived is.
    judged = []
    judge = Worker.judge
    monkeypatch.setattr(Worker, "judge", lambda self, *a: judged.append(a) or judge(self, *a))
    assert [outcome.status for *_, outcome in outcomes(tmp_path, "second")] == [o.status for *_, o in told]
    assert judged == []
    test = tmp_path / "tests/drivers/limit_test.cpp"
    test.write_text(TEST.replace("limit(50) == 10", "limit(50) == 10 && limit(11) == 10"))
    assert os.system(f"ninja -C {tmp_path}/build/host > {tmp_path}/log") == 0
    by_place = {m.begin: o.status for *_, m, o in outcomes(tmp_path, "third") if m.kind == "constant"}
    assert by_place == {LIMIT.index("10"): "killed", LIMIT.index("10;"): "killed"}
    assert len(judged) == sum(o.status == "survived" for *_, o in told)


def test_a_test_that_fails_without_a_change_is_refused(root, tmp_path):
    project(root, tmp_path)
    (tmp_path / "tests/drivers/limit_test.cpp").write_text("int main() { return 1; }\n")
    assert os.system(f"ninja -C {tmp_path}/build/host > {tmp_path}/log") == 0
    try:
        outcomes(tmp_path, "first")
    except RuntimeError as error:
        assert "fails without a change" in str(error)
    else:
        raise AssertionError("a failing test killed every mutant")


def test_mutants_are_of_the_code_alone():
    text = """#include <a>  // 1 + 2
/* 3 < 4 */
template <int N>
std::vector<int> f(const int* p, int&& q) {
  const char* text = "5 - 6";
  if (*p < N && q) { ++n; }
  for (int i = 0; i < N; i++) sum += 1.5 * p[i];
  reset(text);
  int kept = g(0x1F, '7');
  return 2'000 - -1;
}
"""
    assert [(m.line, m.change) for m in mutants(text)] == [
        (6, "*p < N && q → !(*p < N && q)"),
        (6, "< → <="),
        (6, "&& → ||"),
        (6, "++ → --"),
        (7, "0 → 1"),
        (7, "< → <="),
        (7, "++ → --"),
        (7, "sum += 1.5 * p[i]; → ;"),
        (7, "+= → -="),
        (7, "1.5 → 3.0"),
        (7, "* → /"),
        (8, "reset(text); → ;"),
        (9, "0x1F → 0x20"),
        (10, "2'000 → 2001"),
        (10, "- → +"),
        (10, "1 → 2"),
    ]
    for mutant in mutants(text):
        assert mutant.of(text) != text


def test_every_part_has_mutants_and_tests(root):
    for name, part in PARTS.items():
        paths = part.paths(root)
        assert sum(len(mutants(path.read_text())) for path in paths) >= 10, name
        for path in paths:
            assert any(stage.is_for(str(path.relative_to(root))) for stage in part.stages), path
        tests = {str(p.relative_to(root / "tests")) for p in (root / "tests").rglob("*.cpp")}
        for stage in part.stages:
            for pattern in stage.tests:
                assert "*" in pattern or pattern in tests, pattern
