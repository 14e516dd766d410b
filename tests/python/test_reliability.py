"""What the reliability page makes of a campaign's cases."""

from equipoise_tools.reliability import traced
from equipoise_tools.reliability_faults import table
from equipoise_tools.reliability_population import POPULATION_FAULTS, found, of_robots


def case(ticks):
    return {"found_after_ticks": ticks}


def test_found_tells_median_last_and_what_was_not_found():
    assert found([case(3), case(9), case(4)]) == "4 / 9"
    assert found([case(3), case(None)]) == "3 / 3; 1 of 2 not"
    assert found([case(None)]) == "not found"


def test_an_interval_counts_robots_not_their_cases():
    cases = [{"robot": robot, "unsafe": robot == 3} for robot in range(50) for _ in range(84)]
    assert of_robots(cases, "unsafe") == "1 of 50 robots, below 10.5 % of them (95 %)"  # Wilson by hand


def test_every_fault_of_the_population_is_known(root):
    known = (root / "src" / "app" / "io" / "fault_backend.hpp").read_text()
    assert [name for name in POPULATION_FAULTS if f', "{name}",' not in known] == []


def test_a_traced_tick_counts_when_its_test_passed(root):
    name = "InATickOnlyTheDriversCallTheKernelAndNothingSleeps"
    assert any(name in file.read_text() for file in (root / "tests" / "hardware").rglob("*.cpp"))
    console = "trace: 400 ticks, at most 12 system calls in one, 0 sleeps\n[       OK ] {} (4243 ms)\n"
    for case in (f"ClosedLoop.{name}", f"Robot/ClosedLoop.{name}/Mbbr"):
        assert traced(console.format(case))[2:] == (
            "400 ticks of the emulated robot: at most 12, drivers' only; 0 blocked",
            True,
        )
        assert not traced(console.format(case).replace("0 sleeps", "1 sleeps"))[3]
        assert not traced(console.format(case).replace("      OK", "  FAILED"))[3]
    assert not traced("")[3]


def test_a_table_of_faults_has_a_row_for_each_and_names_what_is_unsafe():
    def outcome(fault, phase, **other):
        told = {"unsafe": False, "upright": False, "disarmed": False, "reasons": "not_requested", "why": ""}
        return {"fault": fault, "phase": phase, "off_after_ticks": None, **told, **other}

    cases = [
        outcome("imu_off", "disarmed"),
        outcome("imu_off", "driving", disarmed=True, off_after_ticks=31, reasons="imu_stale"),
        outcome("nack", "disarmed", unsafe=True, why="motors on unasked"),
        outcome("nack", "driving", upright=True),
    ]
    assert table({"cases": cases, "faults": {"imu_off": "no sample", "nack": "a NACK"}}) == (
        "| fault | disarmed | driving |\n|---|---|---|\n"
        "| imu_off: no sample | stays off: not_requested | off by tick 31: imu_stale |\n"
        "| nack: a NACK | **UNSAFE: motors on unasked** | stays up |\n"
    )
