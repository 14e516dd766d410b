"""docs/reports/parts.md is what the configurations, the bodies and the data sheets' numbers come to."""

import numpy as np
import pytest

pytest.importorskip("equipoise_robot._core", reason="needs python3-dev; tools/test installs it")
pytest.importorskip("manifold3d", reason="tools/test installs tools/requirements-optional.txt")
from equipoise_tools import parts
from equipoise_tools.experiments import motor_selection as region


def test_the_committed_page_is_of_these_configurations(root):
    page = (root / "docs/reports/parts.md").read_text(encoding="utf-8")
    for section in (parts.bodies(), parts.motors(), parts.wheels()):
        assert "\n".join(section) in page, "run python -m equipoise_tools.parts"


def test_the_motors_torques_and_speeds_are_of_their_voltage():
    """The dissertation's motor as configured, and a line by hand."""
    rows = {row.split("|")[1].strip(): row.split("|")[2:] for row in parts.motors() if row.startswith("| ")}
    _, no_load, torque, margin = map(float, rows["Pololu 25D 4.4:1 HP 6 V"][:4])
    assert no_load == pytest.approx(2200 * 7.4 / 6, abs=0.5)
    assert torque == pytest.approx(1.2 * 0.0980665 * 7.4 / 6 * (1 - 600 / no_load), abs=6e-4)
    assert margin == pytest.approx(torque / 0.06, abs=0.02)
    ours = parts.MOTORS[0]
    assert ours.stall_N_m == pytest.approx(0.0742 * 7.4 / 3.385)
    assert ours.no_load_rpm * 2 * np.pi / 60 == pytest.approx(7.4 / 0.0742)
    assert region.margins(ours.stall_N_m, ours.no_load_rpm)[0] == pytest.approx(0.06, rel=1e-3)


@pytest.mark.slow
def test_the_robots_with_printed_bodies_stand_as_often_as_the_page_says(root):
    page = (root / "docs/reports/parts.md").read_text(encoding="utf-8")
    assert "\n".join(parts.trials()) in page
