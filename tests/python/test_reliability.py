"""What the reliability page makes of a campaign's cases."""

from equipoise_tools.reliability_population import POPULATION_FAULTS, found


def case(ticks):
    return {"found_after_ticks": ticks}


def test_found_tells_median_last_and_what_was_not_found():
    assert found([case(3), case(9), case(4)]) == "4 / 9"
    assert found([case(3), case(None)]) == "3 / 3; 1 of 2 not"
    assert found([case(None)]) == "not found"


def test_every_fault_of_the_population_is_known(root):
    known = (root / "src" / "app" / "io" / "fault_backend.hpp").read_text()
    assert [name for name in POPULATION_FAULTS if f'{{"{name}",' not in known] == []
