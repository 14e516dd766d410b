"""Noise of gyro and accelerometer: a real log beside simulated robots of its configuration's population.

At rest, standing and rolling, as far as the log has it: per quantity the real value and the simulated
range, and how well a linear discriminant tells windows of one second apart (area under its ROC curve, 0.5:
not at all).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from equipoise_robot import channels as ch
from equipoise_robot.log import Log
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import butter, sosfiltfilt
from scipy.stats import kurtosis, rankdata

from .foreign_log import configuration
from .paths import UserError, binary

HZ = 200
HIGH_PASS_HZ = 20.0
AXES = [f"{sensor} {axis}" for sensor in ("gyro", "accelerometer") for axis in "xyz"]
MOTIONS = {  # s; rolling: on casters
    "mini_segway_log278": {"rest": (0.1, 2.0), "standing": (14.8, 20.2), "rolling": (2.9, 5.4)},
    "regbot_bal_log_2": {"standing": (0.45, 3.05)},
}
ROLLING_RAD_S = 14.8  # of the Mini Segway's wheels then


def imu(log: Path, calibration: dict[str, Any]) -> np.ndarray:
    """Gyro, rad/s, and accelerometer, m/s^2, body axes, before bias and scale are taken off."""
    records = Log(log)[ch.SENSORS]
    turned = np.reshape(calibration["R_BS"], (3, 3)).T
    gyro = records["gyro_counts"] / calibration["gyro_counts_per_deg_s"] * np.pi / 180.0
    accel = records["accel_counts"] / calibration["accel_counts_per_g"] * 9.81
    return np.hstack([gyro @ turned, accel @ turned])


def real_motions(program: Path, table: Path, map_file: Path) -> tuple[Path, dict[str, np.ndarray]]:
    """The robot's configuration, and its motions."""
    if map_file.stem not in MOTIONS:
        raise UserError(f"{map_file}: its motions are not known; known: {', '.join(MOTIONS)}")
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        log = Path(folder) / "real.lcm"
        call = [str(program), "import", str(table), "--map", str(map_file), "-o", str(log), "--json", "-"]
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise UserError(done.stderr.strip())
        config = Path(json.loads(done.stdout)["config"])
        samples = imu(log, configuration(config)["calibration"])
    times = MOTIONS[map_file.stem]
    return config, {name: samples[int(HZ * begin) : int(HZ * end)] for name, (begin, end) in times.items()}


def simulated(program: Path, config: Path, robot: int, settings: list[str], words: str) -> np.ndarray:
    """The same of a robot of the population; each has its own seed."""
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        log = Path(folder) / "run.lcm"
        command = f"sim --config {config} --fidelity full --robot {robot} --seed {robot} --telemetry off"
        # How it shakes is asked, not who falls: nothing is judged.
        command += f" --set safety.detection=false --log {log} --duration-s 12 --json - {words}"
        call = [str(program), *command.split()] + [word for text in settings for word in ("--set", text)]
        done = subprocess.run(call, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1):  # 1: fell
            raise UserError(done.stderr.strip())
        return imu(log, configuration(config)["calibration"])


def simulated_motions(
    program: Path, config: Path, robot: int, settings: list[str] | None = None
) -> dict[str, np.ndarray]:
    """Standing by its own filter, as real robots do; rolling as on casters, which do not balance."""
    given = settings or []
    standing = simulated(program, config, robot, given, "--drive-mps 0")
    speed = ROLLING_RAD_S * configuration(config)["robot"]["wheel_radius_m"]
    rolling = simulated(program, config, robot, given, f"--estimator truth --drive-mps {speed}")
    return {"rest": standing[: HZ // 2], "standing": standing[3 * HZ :], "rolling": rolling[5 * HZ :]}


def whole(made: list[dict[str, np.ndarray]], motion: str) -> list[np.ndarray]:
    """Of the robots whose run was not cut short by a fall."""
    least = HZ // 2 if motion == "rest" else 2 * HZ
    return [robot[motion] for robot in made if len(robot[motion]) >= least]


def high_passed(samples: np.ndarray) -> np.ndarray:
    out: np.ndarray = sosfiltfilt(butter(4, HIGH_PASS_HZ, "high", fs=HZ, output="sos"), samples, axis=0)
    return out


def shape(samples: np.ndarray) -> dict[str, list[float]]:
    """Of each axis, above 20 Hz."""
    x = high_passed(samples)
    sigma = x.std(axis=0)
    lag_1 = (x[1:] * x[:-1]).mean(axis=0) / sigma**2
    return {"sigma": sigma.tolist(), "lag_1": lag_1.tolist(), "excess_kurtosis": kurtosis(x).tolist()}


def features(samples: np.ndarray) -> np.ndarray:
    """Of each window of a second, half overlapping: logarithm of sigma, lag-1 correlation, tails."""
    noise = high_passed(samples)
    rows = []
    for begin in range(0, len(noise) - HZ + 1, HZ // 2):
        x = noise[begin : begin + HZ]
        sigma = x.std(axis=0) + 1e-9
        lag_1 = (x[1:] * x[:-1]).mean(axis=0) / sigma**2
        rows.append(np.hstack([np.log(sigma), lag_1, np.log(3.0 + kurtosis(x))]))
    return np.array(rows)


def area_under_curve(scores: np.ndarray, positive: np.ndarray) -> float:
    """Share of pairs in order: Mann and Whitney's statistic."""
    ranks = rankdata(scores)
    n, m = positive.sum(), (~positive).sum()
    return float((ranks[positive].sum() - n * (n + 1) / 2.0) / (n * m))


def told_apart(real: np.ndarray, made: np.ndarray, folds: int = 5) -> float:
    """AUC of Fisher's linear discriminant on windows that it was not fitted to; neighbours share a fold."""
    x = np.vstack([real, made])
    is_real = np.arange(len(x)) < len(real)
    fold = np.hstack([np.arange(n) * folds // n for n in (len(real), len(made))])
    scores = np.empty(len(x))
    for k in range(folds):
        fit = fold != k
        centre, scale = x[fit].mean(axis=0), x[fit].std(axis=0) + 1e-9
        z = (x - centre) / scale
        means = [z[fit & (is_real == kind)].mean(axis=0) for kind in (False, True)]
        within = z[fit] - np.array(means)[is_real[fit].astype(int)]
        covariance = within.T @ within / fit.sum()
        shrunk = 0.8 * covariance + 0.2 * np.trace(covariance) / len(covariance) * np.eye(len(covariance))
        scores[fold == k] = (z @ cho_solve(cho_factor(shrunk), means[1] - means[0]))[fold == k]
    return area_under_curve(scores, is_real)


def own_auc(made: list[np.ndarray], windows: int) -> float | None:
    """The same of each simulated robot against the others, median: how far a robot of the population gets."""
    aucs = []
    for k, own in enumerate(made):
        others = [other for j, other in enumerate(made) if j != k]
        if others and len(own) >= windows:
            aucs.append(told_apart(own[:windows], np.vstack(others), folds=min(5, windows // 2)))
    return float(np.median(aucs)) if aucs else None


def each_alone(real: np.ndarray, made: np.ndarray) -> dict[str, float]:
    """AUC of each feature by itself, the most telling first; below 0.5: less of it in the real log."""
    is_real = np.arange(len(real) + len(made)) < len(real)
    names = [f"{what} {axis}" for what in ("sigma", "lag-1", "kurtosis") for axis in AXES]
    aucs = {
        name: area_under_curve(column, is_real)
        for name, column in zip(names, np.vstack([real, made]).T, strict=True)
    }
    return dict(sorted(aucs.items(), key=lambda item: -abs(item[1] - 0.5)))


def compare(real: dict[str, np.ndarray], made: list[dict[str, np.ndarray]]) -> dict:
    result: dict = {}
    for name, samples in real.items():
        sigma = high_passed(samples).std(axis=0)
        runs = whole(made, name)
        if not runs:
            raise UserError(f"{name}: no simulated robot stayed up")
        drawn = np.array([high_passed(run).std(axis=0) for run in runs])
        low, middle, high = np.quantile(drawn, [0.0, 0.5, 1.0], axis=0)
        outside = np.maximum(np.maximum(low / sigma, sigma / high), 1.0)
        result[name] = {
            "quantities": {
                axis: {"real": r, "simulated": [lo, mid, hi], "outside_by": factor}
                for axis, r, lo, mid, hi, factor in zip(
                    AXES, *(v.tolist() for v in (sigma, low, middle, high, outside)), strict=True
                )
            }
        }
        windows = features(samples)
        if name != "rest" and len(windows) >= 4:
            of_each = [features(run) for run in runs]
            others = np.vstack(of_each)
            result[name] |= {"real_windows": len(windows), "simulated_windows": len(others)}
            result[name]["auc"] = told_apart(windows, others, folds=min(5, len(windows) // 2))
            result[name]["own_auc"] = own_auc(of_each, len(windows))
            result[name]["features"] = each_alone(windows, others)
    return result


def page(result: dict) -> str:
    lines = []
    for name, motion in result.items():
        auc = ""
        if "auc" in motion:
            auc = f"; AUC {motion['auc']:.2f} on {motion['real_windows']} real windows"
            own = motion["own_auc"]
            auc += "" if own is None else f", of a simulated robot against the others {own:.2f}"
        lines += [
            f"{name}{auc}",
            "",
            "| sigma above 20 Hz | real | simulated: least, median, most | outside by |",
        ]
        lines += ["|---|---|---|---|"]
        for axis, row in motion["quantities"].items():
            made = ", ".join(f"{value:.4f}" for value in row["simulated"])
            lines.append(f"| {axis} | {row['real']:.4f} | {made} | x {row['outside_by']:.1f} |")
        telling = ", ".join(f"{axis} {auc:.2f}" for axis, auc in [*motion.get("features", {}).items()][:6])
        lines += ["", f"Alone: {telling}"] if telling else []
        lines.append("")
    return "\n".join(lines)


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="noise_comparison", description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path, help="the real robot's")
    parser.add_argument("--map", type=Path, required=True, help="its map: config/real/maps")
    parser.add_argument("--robots", type=int, default=60)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of equipoise sim")
    parser.add_argument("--json", type=Path, help="write the numbers here")
    given = parser.parse_args(words)
    if not given.log.exists():
        parser.error(f"{given.log}: cannot be opened")
    program = binary()
    robots = range(1, given.robots + 1)
    config, real = real_motions(program, given.log, given.map)
    made = [simulated_motions(program, config, robot, given.set) for robot in robots]
    result = compare(real, made)
    if given.json:
        given.json.write_text(json.dumps(result, indent=1) + "\n")
    print(page(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
