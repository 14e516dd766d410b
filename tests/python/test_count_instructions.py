"""The tick's instructions: stages of a profile, the committed counts, and that nothing grows beyond them."""

import json
import shutil

import pytest
from equipoise_tools import count_instructions as count
from equipoise_tools import count_page, precision

GROWTH = 1.03

PROFILE = """\
summary: 400
fl=(1) /src/include/equipoise/pipeline.hpp
fn=(1) equipoise::Pipeline<equipoise::Mbbr, equipoise::MbbrEstimators>::tick(rio_sensors const&)
10 5
fi=(2) /src/include/equipoise/actuate/safety.hpp
20 7
fe=(1)
cfi=(3) /src/src/robots/mbbr/estimators.cpp
cfn=(2) equipoise::MbbrEstimators::update(equipoise::Measurement<3> const&)
calls=1 30
12 100
cfn=(3) equipoise::Pipeline<equipoise::Mbbr, equipoise::MbbrEstimators>::invert_bridges()
calls=1 30
+1 40

fl=(3)
fn=(2)
30 100
"""


def test_a_profile_is_split_into_the_stages_of_the_tick():
    assert count.by_stage(PROFILE) == {
        "total": 400,
        "sense": 0,
        "estimate": 100,
        "reference": 0,
        "control": 0,
        "bridge": 40,
        "safety": 7,
        "rest": 5,
    }


def test_a_functions_cycles_are_its_stages():
    said = """instructions 5
function 300 _ZN9equipoise6Safety4gateERK12rio_motors_tRKNS_12SafetyInputsE
function 40 _ZNK9equipoise17DriveCoastInverse5solveEdd
function 2 _ZNK9equipoise17DriveCoastInverse5solveEdd
function 1 libraries
function 5 _ZN9equipoise9generated10MbbrFilter7predictERKNS1_9ConstantsIfEEPKfPfS7_
function 7 memcpy
"""
    stages = count.stages_of(count.by_function(said))
    assert {k: v for k, v in stages.items() if v} == {
        "estimate": 5,
        "bridge": 42,
        "safety": 300,
        "libraries": 1,
        "rest": 7,
    }


@pytest.fixture(scope="module")
def committed(root):
    return json.loads((root / count_page.TABLE).read_text(encoding="utf-8"))


def grown(machine, robot, committed, *parts):
    cost = count.costs(machine, robot, detector="tick_of_one_filter" in parts)
    return {k: (committed[robot][k], cost[k]) for k in parts if cost[k] > GROWTH * committed[robot][k]}


@pytest.mark.slow
@pytest.mark.parametrize("robot", count_page.ROBOTS)
def test_a_tick_costs_no_more_than_committed(root, committed, robot):
    machine = count.Callgrind(root)
    if shutil.which("valgrind") is None or not machine.program.is_file():
        pytest.skip("needs valgrind and the host build")
    parts = ("tick", "filter", "log", "simulated_tick")
    assert (
        grown(machine, robot, committed["x86"], *parts) == {}
    ), "if it has to be: tools/count_instructions --write"


@pytest.mark.cross
@pytest.mark.parametrize("robot", count_page.ROBOTS)
def test_nor_does_it_on_the_robots_processor(root, committed, robot, tmp_path):
    machine = count.CortexA8(root, str(tmp_path))
    parts = ("tick_of_one_filter", "filter")
    assert grown(machine, robot, committed["cortex_a8"], *parts) == {}


# Of instructions. A float lane takes one to load and one to use on x86, a double pair one for both.
SHARE_OF_DENSE = {"x86": 0.28, "cortex_a8": 0.2}


@pytest.fixture(scope="module", params=SHARE_OF_DENSE)
def machine_counts(root, request):
    counts = json.loads((root / count_page.TABLE).read_text(encoding="utf-8"))[request.param]
    return counts | {"share": SHARE_OF_DENSE[request.param]}


@pytest.mark.parametrize("robot", count_page.ROBOTS)
def test_a_tick_costs_a_share_of_one_with_the_dense_filter(machine_counts, robot):
    counts, share = machine_counts[robot], machine_counts["share"]
    assert counts["tick"] <= share * counts["dense_tick"]
    alone = counts["tick_of_one_filter"]
    assert alone <= share * (alone - counts["filter"] + counts["dense_filter"])
    assert counts["filter"] <= 0.75 * share * counts["dense_filter"]


MOST_FILTER_CYCLES = {"mbbr": 40_000, "mip": 14_000}


@pytest.mark.parametrize("robot", count_page.ROBOTS)
def test_the_robots_processor_needs_few_cycles_for_a_tick_in_every_mode(committed, robot):
    counts = committed["cortex_a8"][robot]
    assert counts["filter_cycles"] <= MOST_FILTER_CYCLES[robot]
    assert counts["bank_in_filters"] <= 5.0
    assert counts["tick_cycles"] <= 0.1 * counts["dense_tick_cycles"]
    assert set(counts["modes"]) == set(count_page.MODES)
    longest = max(mode["most"] for mode in counts["modes"].values())
    assert longest <= count_page.LONGEST_TICK_S * count_page.CLOCK_HZ


def test_the_mbbrs_log_costs_a_quarter_of_a_tick(committed):
    mbbr = committed["x86"]["mbbr"]
    assert mbbr["log"] <= 0.25 * mbbr["tick"]


def test_the_bridges_inversion_costs_two_fifths_of_newtons(machine_counts):
    bridge = machine_counts["bridge"]
    assert bridge["inversion"] <= 0.4 * bridge["newton"]


def test_the_whole_firmwares_load_is_the_ticks_cycles_and_what_the_other_instructions_take():
    console = """VM: running
equipoise: warning
{"instructions":{"guard":1000.4,"kernel":2000.0,"loop":3000.0,"threads":4000.0},"load":"mbbr"}
"""
    assert count.firmware_load(console) is None, "one robot is missing"
    console += console.replace("mbbr", "mip").replace("4000.0", "14000.0")
    firmware = count.firmware_load(console)
    assert firmware["mbbr"] == {"guard": 1000, "kernel": 2000, "loop": 3000, "threads": 4000}
    robots = {r: {"tick_cycles": 41500} for r in count_page.ROBOTS}
    load = count_page.whole_load(firmware, {"mbbr": 1500, "mip": 1500}, robots)
    # 41,500 and twice, 3 or 4 times 8,500 cycles, of 5,000,000
    assert load["mbbr"] == pytest.approx({2: 0.0117, 3: 0.0134, 4: 0.0151})
    assert load["mip"] == pytest.approx({2: 0.0157, 3: 0.0194, 4: 0.0231})


def test_the_page_has_the_committed_numbers(root):
    assert (root / count_page.PAGE).read_text(encoding="utf-8") == count_page.performance_page(root)


def made(attitude, ended="finished"):
    return {"ended": ended, "attitude_rmse_rad": attitude, "yaw_frame_speed_rmse_m_s": 1.0}


def test_errors_in_single_precision_are_compared_in_pairs():
    double = [made(0.01 * k) for k in range(1, 200)]
    single = [made(1.02 * d["attitude_rmse_rad"]) for d in double]
    single[0] = made(None, "fell")  # nothing to compare: its end says it
    found = precision.compared(single, double)
    assert found["finished"] == {"single": 198, "double": 199, "both": 198}
    for share in ("0.5", "0.95"):
        assert found["attitude_rmse_rad"][share] == pytest.approx([0.02] * 3)
        assert found["yaw_frame_speed_rmse_m_s"][share] == [0.0] * 3
