"""The filters that the default one is compared with: of its model, right where theory says what is right."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from equipoise_tools.estimator_comparison import __main__ as comparison
from equipoise_tools.estimator_comparison import drawn, judge, page
from equipoise_tools.estimator_comparison.filters import (
    ErrorState,
    Extended,
    Unscented,
    WithHeading,
    WithTorques,
    body_rates,
    rotation,
)
from equipoise_tools.estimator_comparison.model import GROUPS, SCALE, Model, N, robot_of
from equipoise_tools.estimator_comparison.recorded import record, run_filter, samples_of
from equipoise_tools.paths import UserError
from scipy.stats import chi2

THREE = (Extended, Unscented, ErrorState)
TICKS, SETTLED = 400, 100


@pytest.fixture(scope="module")
def config(root):
    return tomllib.loads((root / "config/mbbr.toml").read_text())


@pytest.fixture(scope="module")
def run():
    """Mild: a slow turn in the nominal world."""
    return record(0, 0.5, 0.1, 7.0, 3, fidelity="nominal")


@pytest.fixture(scope="module")
def samples(config):
    return drawn.draw(robot_of(config), runs=10, ticks=TICKS, yaw_hz=0.3, seed=5)


def nis_of(kind, samples):
    nis = np.square(run_filter(kind, samples).nu[SETTLED:])
    return {name: nis[:, rows].mean() for name, rows in GROUPS.items()}


def band(samples, group, confidence=0.9999):
    """Of the mean of so many squares of standard normals."""
    rows = GROUPS[group]
    freedom = (TICKS - SETTLED) * (rows.stop - rows.start) * samples.y.shape[-1]
    return tuple(chi2.ppf([0.5 - confidence / 2, 0.5 + confidence / 2], freedom) / freedom)


def test_the_extended_filter_is_the_firmwares(config):
    """With more gyro noise than it measures: what the gyro shakes beyond it, the firmware's filter adds."""
    noise = [0.01, 0.01, 0.01, *config["estimator"]["ekf"]["r"][3:]]
    run = record(0, 0.5, 0.1, 7.0, 3, settings={"estimator.ekf.r": noise}, fidelity="nominal")
    samples = samples_of([run])
    assert np.abs(run_filter(Extended, samples).five - samples.own).max() < 1e-9
    told_wrongly = samples_of([run], l=0.101)
    assert np.abs(run_filter(Extended, told_wrongly, 200).five - samples.own[:200]).max() > 1e-5


def test_the_filters_agree_on_a_mild_run(run):
    """Once each has found the mount: the error that is left is the same one. Sigma points see what F has as
    they see it; the extended filter with a whole F shows that it is this."""
    samples = samples_of([run])
    late = samples.t_s > 5.0

    def apart(one, other):
        return judge.rms((one - other)[late, :2])

    found = {kind: run_filter(kind, samples).five for kind in (*THREE, WithTorques)}
    error = apart(found[Extended], samples.truth)
    assert apart(found[ErrorState], found[Extended]) < 0.2 * error
    assert apart(found[Unscented], found[WithTorques]) < 0.2 * error
    assert apart(found[Unscented], found[Extended]) < error


def test_the_whole_F_is_the_derivative_of_the_step(config):
    rng = np.random.default_rng(4)
    model = Model(robot_of(config))
    model.Q = np.zeros((N, N))
    x, u = 0.1 * rng.standard_normal((N, 1)), 0.2 * rng.standard_normal((3, 1))
    x[7] = 9.0
    filter_ = WithTorques(model, x)
    filter_.P = np.eye(N)[None]
    filter_._propagate(u)
    h = 1e-6 * np.eye(N)
    slopes = [model.step(x + d[:, None], u, x[SCALE]) - model.step(x - d[:, None], u, x[SCALE]) for d in h]
    F = np.hstack(slopes) / 2e-6
    np.testing.assert_allclose(filter_.P[0], F @ F.T, atol=1e-7)


@pytest.mark.parametrize("kind", THREE, ids=lambda kind: kind.name)
def test_what_is_drawn_from_the_model_is_consistent_and_a_planted_fault_is_not(kind, samples, config):
    for group, nis in nis_of(kind, samples).items():
        low, high = band(samples, group)
        assert low < nis < high, f"{group}: {nis} not in {low} to {high}"
    weak = replace(robot_of(config, k1=0.8 * config["robot"]["k1_N_m"]), age_s=0.0)
    low, high = band(samples, "gyro")
    assert not low < nis_of(kind, replace(samples, robot=weak))["gyro"] < high


def test_innovations_of_the_right_model_are_white_and_of_a_wrong_one_are_not(samples):
    def lag(told):
        return judge.correlations(run_filter(Extended, told).nu[SETTLED:])[0, 3:6].mean()

    expected = 1.0 / np.sqrt((TICKS - SETTLED) * 3 * samples.y.shape[-1])
    assert abs(lag(samples)) < 4.0 * expected
    wheels = samples.robot.r * np.where(np.arange(8) // 3 == 1, 100.0, 1.0)
    assert lag(replace(samples, robot=replace(samples.robot, r=wheels))) > 4.0 * expected


def test_heading_as_a_state_drifts_less_and_leaves_the_rest_alone(samples):
    without, with_heading = (run_filter(kind, samples).five for kind in (Extended, WithHeading))
    np.testing.assert_allclose(with_heading[:, :4], without[:, :4], atol=1e-9)
    errors = [np.abs((five - samples.truth)[-1, 4]).mean() for five in (without, with_heading)]
    assert errors[1] < 0.5 * errors[0]


def test_a_row_that_is_not_used_says_nothing(samples):
    half = np.ones_like(samples.use)
    half[:, 0] = 0.0
    other = samples.y.copy()
    other[:, 0] = 1e3
    for kind in THREE:
        first, second = (run_filter(kind, replace(samples, use=half, y=y), 20) for y in (samples.y, other))
        np.testing.assert_array_equal(first.five, second.five)
        assert not first.nu[:, 0].any()


def test_the_error_states_chart_is_the_derivative_of_its_correction(config):
    rng = np.random.default_rng(1)
    x = np.zeros((N, 1))
    x[:2, 0], x[5:8, 0] = [0.2, -0.15], [0.5, -0.7, 15.0]
    start = ErrorState(Model(robot_of(config)), x)
    for _ in range(5):
        by = np.zeros((N + 1, 1))
        by[ErrorState.PLACES, 0] = 1e-6 * rng.standard_normal(6)
        moved = ErrorState(Model(robot_of(config)), x)
        moved._shift(by)
        change = np.append(moved.x - x, moved.heading_rad[None], axis=0)
        np.testing.assert_allclose(start._to_errors()[0] @ change, by, atol=2e-10)
        # And what it says: the attitude has turned by xi in the yaw frame, the body rates by their error.
        heading = moved.heading_rad[0]
        c, s = np.cos(heading), np.sin(heading)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        turned = turn @ rotation(moved.x[:2])[0] @ rotation(x[:2])[0].T
        xi = [turned[2, 1], turned[0, 2], turned[1, 0]]
        np.testing.assert_allclose(xi, by[[0, 1, N], 0], atol=1e-11)
        rates = [body_rates(v[:2], v[5:8]) for v in (moved.x, x)]
        np.testing.assert_allclose(rates[0] - rates[1], by[5:8], atol=1e-12)


def test_sigma_points_have_the_mean_and_covariance_they_stand_for(config):
    rng = np.random.default_rng(2)
    filter_ = Unscented(Model(robot_of(config)), rng.standard_normal((N, 3)))
    root = rng.standard_normal((3, N, N))
    filter_.P = root @ root.transpose(0, 2, 1) + np.eye(N)
    mean, away = filter_._spread(filter_._points())
    np.testing.assert_allclose(mean, filter_.x, atol=1e-10)
    P = (away * filter_.weight) @ away.transpose(0, 2, 1)
    np.testing.assert_allclose(P, filter_.P, rtol=1e-9, atol=1e-9)


def test_the_page_shows_what_the_data_say(root, tmp_path):
    """Its tables and its picture are those of its data."""
    from equipoise_tools.estimator_comparison import measure

    reports = root / "docs/reports"
    text = (reports / "estimators.md").read_text()
    shown = text.split(page.BEGIN, 1)[1].split(page.END, 1)[0].strip()
    rows = measure.read(reports / "estimators.parquet")
    assert shown == page.tables(rows).strip()
    page.draw(rows, tmp_path)
    assert (tmp_path / "estimators.png").read_bytes() == (reports / "estimators.png").read_bytes()


def test_new_tables_bring_their_commit_and_date(tmp_path):
    path = tmp_path / "estimators.md"
    path.write_text(f"# T\nMeasured at 1234567, 2026-01-02.\n{page.BEGIN}\nold\n{page.END}\n")
    page.insert(path, "kept")
    assert "Measured at 1234567, 2026-01-02." in path.read_text() and "old" not in path.read_text()
    page.insert(path, "new", "89abcde-dirty, 2026-03-04")
    assert path.read_text() == f"# T\nMeasured at 89abcde-dirty, 2026-03-04.\n{page.BEGIN}\nnew\n{page.END}\n"


def test_data_that_are_not_there_are_named(tmp_path):
    with pytest.raises(UserError, match=r"estimators\.parquet: cannot be read; run without --from-data"):
        comparison.main(["--from-data", "--out", str(tmp_path)])
