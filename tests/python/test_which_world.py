"""Worlds from printed rows: planted friction and delay are found, rows that exclude each other named."""

import numpy as np
import pytest
from equipoise_tools import which_world, which_world_page
from equipoise_tools.inference import Draw, Inference, Parameter, quantiles, weights_of
from equipoise_tools.which_world import Row, run_rows

FRICTION, DELAY = "Coulomb friction over identified", "delay of the loop"


def interval(found: Inference, name: str) -> tuple[float, float]:
    values = [found.values(d.shares)[name] for d in found.kept]
    low, _, high = quantiles(values, weights_of(found.kept))
    return low, high


def test_a_planted_friction_and_delay_are_found(monkeypatch):
    monkeypatch.setattr(which_world, "DURATION_S", 10.0)
    parameters = tuple(p for p in which_world.WORLD if p.name in (FRICTION, DELAY))
    others = {p.name: p.value(0.0) for p in which_world.PARAMETERS} | {
        "motor torque over identified": 1.0,
        "back-EMF over identified": 1.0,
        "IMU mount about x": 0.0,
        "IMU mount about y": 0.0,
        "wheel grip (from 0.9: no slip)": 1.0,
        **{p.name: p.choices[1] for p in which_world.PRINTS},
    }
    planted = {FRICTION: 1.8, DELAY: 6}
    shown = ("attitude_rmse_rad", "ball_speed_rmse_m_s")
    blank = dict.fromkeys(shown, 1.0)
    rows = (
        Row("in place", "6.1", 0.0, 0.0, printed=blank),
        Row("on the way", "6.1", 0.25, 0.1, printed=blank),
    )
    truth = run_rows(rows, others | planted, seed=999)
    assert all(truth[row.name]["upright_s"] == 10.0 for row in rows)
    measured = tuple(
        Row(r.name, r.group, r.yaw_hz, r.drive_mps, printed={q: truth[r.name][q] for q in shown})
        for r in rows
    )
    found = Inference(
        parameters, measured, lambda at, seed: run_rows(rows, others | at, seed), 40, 15, jobs=2
    )
    for _ in range(5):
        found.step()
    for name, prior in ((FRICTION, 1.5), (DELAY, 14)):
        low, high = interval(found, name)
        assert low <= planted[name] <= high, (name, low, high)
        assert high - low < 0.5 * prior, (name, low, high)


def line(**errors: str):
    """A world with one number, from which a row's error follows without noise."""
    rows = tuple(Row(name, "6.1", 0.0, 0.0, printed={"attitude_rmse_rad": 0.1}) for name in errors)

    def run(at: dict, _seed: int) -> dict:
        x = at["x"]
        error = {"rises": 0.1 * np.exp(4 * (x - 0.3)), "falls": 0.1 * np.exp(4 * (0.9 - x))}
        return {
            name: {"upright_s": which_world.DURATION_S, "attitude_rmse_rad": error[how]}
            for name, how in errors.items()
        }

    return Inference((Parameter("x"), Parameter("coin", choices=("a", "b"))), rows, run, 100, 30)


def test_weights_make_up_for_where_draws_come_from():
    """Proposals around 0.3 and mostly heads: by their weights they are the prior again, uniform and fair."""
    found = line(A="rises")
    kept = [Draw([0.25 + 0.01 * i, 0.2 if i else 0.7], {}) for i in range(10)]
    spread, rng = np.array([0.35, 0.35]), np.random.default_rng(1)
    drawn = np.array([found._moved(rng, kept, spread) for _ in range(2000)])
    weights = np.array([found._weight(shares, kept, spread) for shares in drawn])
    heads = drawn[:, 1] < 0.5
    assert drawn[:, 0].mean() < 0.42 and heads.mean() > 0.75
    assert weights.mean() == pytest.approx(1.0, abs=0.05)
    weights /= weights.sum()
    assert weights @ drawn[:, 0] == pytest.approx(0.5, abs=0.03)
    assert weights @ (drawn[:, 0] ** 2) == pytest.approx(1 / 3, abs=0.03)
    assert weights @ heads == pytest.approx(0.5, abs=0.05)


def test_draws_come_nearer_to_what_is_printed():
    """The printed error allows 0.3 +- log(1.3) / 4."""
    found = line(A="rises")
    found.step()
    while found.kept[-1].distance > 0.5:
        found.step()
    low, high = interval(found, "x")
    assert 0.2 < low < 0.3 < high < 0.4


def test_rows_that_exclude_each_other_are_named():
    found = line(A="rises", B="falls")
    found.step()
    text = "\n".join(which_world_page.exclusions(found, at_least=3))
    pairs = text.partition("Pairs of which")[2]
    assert "A: tilt error" in pairs and "B: tilt error" in pairs
    assert "none" in text.partition("no draw meets")[2].partition("Pairs")[0]
    agreeing = line(A="rises", B="rises")
    agreeing.step()
    assert "| none |" in "\n".join(which_world_page.exclusions(agreeing, at_least=3))


def test_a_row_left_out_is_predicted_by_the_others():
    found = line(A="rises", B="falls")
    for _ in range(3):
        found.step()
    near = [d for d in found.draws if which_world_page.agrees(found.rows[0], "attitude_rmse_rad", d)]
    found.keep = len(near)
    without = found.left_out("B")
    assert len(near) > 10 and {id(d) for d in without} == {id(d) for d in near}
    assert not any(which_world_page.agrees(found.rows[1], "attitude_rmse_rad", d) for d in without)
    assert {id(d) for d in found.kept} != {id(d) for d in near}


def test_every_row_of_t_is_asked_once_and_with_its_own_numbers():
    rows = which_world.rows_of_t()
    assert len({row.name for row in rows}) == len(rows) == 7 + 5 + 4 + 4
    lost = [row for row in rows if not row.stood]
    assert [row.name for row in lost] == ["Fig. 6.28, EKF, 1.5 Hz, 5 cm/s"]
    row = lost[0]
    assert row.off("upright_s", {"upright_s": 8.0}) == 0
    assert row.off("upright_s", {"upright_s": 3.0}) > 1 < row.off("upright_s", {"upright_s": 15.0})
