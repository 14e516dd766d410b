"""Windows of noise are told apart where they differ, and only there; a real log beside the population."""

import numpy as np
import pytest
from driven import real_log
from equipoise_tools import noise_comparison


def noise(seed, sigma=0.01, keep=0.0, seconds=30):
    rng = np.random.default_rng(seed)
    white = rng.normal(size=(seconds * noise_comparison.HZ, 6))
    coloured = white.copy()
    for i in range(1, len(white)):
        coloured[i] = keep * coloured[i - 1] + np.sqrt(1.0 - keep**2) * white[i]
    return sigma * coloured


def test_area_under_the_curve_is_the_share_of_pairs_in_order():
    scores = np.array([3.0, 1.0, 2.0, 0.0])
    assert noise_comparison.area_under_curve(scores, np.array([True, True, False, False])) == 0.75


def test_the_same_noise_is_not_told_apart():
    f = noise_comparison.features
    assert 0.3 < noise_comparison.told_apart(f(noise(1)), f(noise(2))) < 0.7


@pytest.mark.parametrize("other", [{"sigma": 0.02}, {"keep": -0.6}])
def test_noise_of_another_size_or_colour_is_told_apart(other):
    f = noise_comparison.features
    assert noise_comparison.told_apart(f(noise(1)), f(noise(2, **other))) > 0.95


def test_a_robot_unlike_the_others_is_told_from_its_own_population():
    f = noise_comparison.features
    alike = [f(noise(seed, seconds=10)) for seed in (1, 2)]
    unlike = [f(noise(seed, keep=keep, seconds=10)) for seed, keep in ((1, 0.0), (2, 0.6))]
    assert noise_comparison.own_auc(alike, 9) < 0.75
    assert noise_comparison.own_auc(unlike, 9) > 0.95
    assert noise_comparison.own_auc(alike[:1], 9) is None


@pytest.mark.parametrize("name", noise_comparison.MOTIONS)
def test_real_noise_lies_within_a_factor_of_the_population(root, name):
    map_file, binary = root / f"config/real/maps/{name}.toml", root / "build/host/equipoise"
    config, real = noise_comparison.real_motions(binary, real_log(root, map_file), map_file)
    made = [noise_comparison.simulated_motions(binary, config, robot) for robot in (1, 2, 3, 4)]
    result = noise_comparison.compare(real, made)
    # A gross error of unit, frame or shape is a factor of ten.
    assert "standing" in result
    for motion in result.keys() - {"rolling"}:
        for axis, row in result[motion]["quantities"].items():
            assert row["outside_by"] < 5.0, (motion, axis, row)
    assert 0.5 <= result["standing"]["auc"] <= 1.0


def test_a_map_whose_motions_are_not_known_is_refused(root, tmp_path):
    other = tmp_path / "other.toml"
    with pytest.raises(noise_comparison.UserError, match="known: mini_segway_log278"):
        noise_comparison.real_motions(root / "build/host/equipoise", tmp_path / "log.csv", other)
