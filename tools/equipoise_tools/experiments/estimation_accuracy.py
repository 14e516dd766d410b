"""6.4.4: EKF, KF and DMP while spinning in place (Fig. 6.14 to 6.23), and the gains of Table 6.2."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from equipoise_robot.log import Log

from .. import metrics, names, published, style
from ..style import plt
from . import published_kf, timeplot
from .data import Data
from .framework import Result
from .runs import BUILT, NO_GATES, Case, equipoise_json

YAW_HZ = (0.0, -1.5, -1.0, -0.75, -0.5, 0.5, 0.75, 1.0, 1.5)
FIGURES = {hz: f"Fig. 6.{15 + i}" for i, hz in enumerate(YAW_HZ)}
COVERS = ("Fig. 6.14", "Fig. 6.14, KF and EKF equal in ball speed", *FIGURES.values(), "Table 6.2")
WORLD = BUILT
DURATION_S = 60.0
PUBLISHED_KF = "kf as published"
COMPARED = ("ekf13_published", PUBLISHED_KF, "kf_attitude", "ekf13", "ekf")
TABLE_6_2_HZ = tuple(published.table()["Table 6.2"]["yaw_hz"])
SECTION = "(6.30)"
CLOSE = 2.0  # "relatively close": within a factor of two
IN_CONTROL = ("ekf13_published", "ekf")
SPEEDS = ("yaw_frame_speed_rmse_m_s", "heading_drift_rad")


@cache
def T_ob() -> np.ndarray:
    return np.array(equipoise_json("geometry", "--alpha-deg", 60, "--azimuth-deg", -140)["T_ob"])


def errors(log: Log, summary: dict) -> dict:
    """Of every filter, after 5 s: attitude, ball speed in the yaw frame (no heading in it), heading's "
    "drift."""
    found = {}
    truth = log[names.TRUTH]
    settled = log.seconds(names.TRUTH) >= metrics.SETTLE_S
    if settled.sum() < 2:
        return found
    radius_m = metrics.run_record(log).rolling_radius_m
    for name, channel in metrics.estimator_channels(log).items():
        estimate, true = metrics.aligned(log, channel, names.TRUTH)
        counted = (estimate["utime"] - log.start_utime) * 1e-6 >= metrics.SETTLE_S
        off = (estimate["phi_dot_rad_s"] - true["phi_dot_rad_s"])[counted]
        if name != summary["estimator"]:
            found[name, "yaw_frame_speed_rmse_m_s"] = radius_m * metrics.rms(off)
        heading = metrics.wrapped(estimate["theta_rad"][:, 2] - true["theta_rad"][:, 2])
        found[name, "heading_drift_rad"] = abs(float(np.unwrap(heading)[-1] - heading[0]))
    states = published_kf.estimate(log, T_ob())
    at = truth["tick"][settled] - log[names.SENSORS]["tick"][0]
    at = at[at < len(states)]
    kept = truth[settled][: at.size]
    off = states[at, :2] - kept["theta_rad"][:, :2]
    found[PUBLISHED_KF, "attitude_rmse_rad"] = metrics.rms(off)
    found[PUBLISHED_KF, "yaw_frame_speed_rmse_m_s"] = radius_m * metrics.rms(
        states[at, 6:] - kept["phi_dot_rad_s"]
    )
    return found


def trace(log: Log) -> dict:
    found = timeplot.series_of(
        log, timeplot.channels("our EKF", "ekf13_published", "kf_attitude"), position=False
    )
    states = published_kf.estimate(log, T_ob())
    t_s = log.seconds(names.SENSORS)
    for axis, name in enumerate("xy"):
        found[f"kf as published theta_{name}"] = t_s, states[:, axis]
    return {series: values for series, values in found.items() if not series.startswith("reference")}


def case_name(hz: float) -> str:
    return f"in place, {hz:g} Hz"


def table_case(world: str, filter_name: str, hz: float) -> str:
    return f"Table 6.2, {world}, {filter_name}, {hz:g} Hz"


def cases() -> list[Case]:
    found = [
        Case(
            case_name(hz),
            sets=NO_GATES,
            section=SECTION,
            options={"yaw_hz": hz, "compare": True, "duration_s": DURATION_S, "fidelity": WORLD},
            measure=errors,
            trace=trace,
            trace_s=(20.0, 30.0),
        )
        for hz in YAW_HZ
    ]
    found += [
        Case(
            table_case(world, name, hz),
            sets={**NO_GATES, **published.gains("Table 6.2")},
            section=SECTION if name == "ekf13_published" else "",
            options={
                "controller": "thesis",
                "estimator": name,
                "yaw_hz": hz,
                "duration_s": DURATION_S,
                "fidelity": world,
            },
            gains="[T] Table 6.2",
        )
        for world in (WORLD, "nominal")
        for name in IN_CONTROL
        for hz in TABLE_6_2_HZ
    ]
    return found


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Estimators while spinning in place (Fig. 6.14 to 6.23, Table 6.2)",
        command="equipoise sim --config config/mbbr.toml --fidelity built2025 --yaw-hz 1 --compare "
        "--duration-s 60",
        method=f"Spin in place at nine yaw rates, {DURATION_S:.0f} s, {WORLD} world; our EKF and the "
        "scheduled gains "
        "control, all filters see the same samples. Errors of the ball's speed are taken in the yaw "
        "frame, where the "
        "heading has no part; the heading's drift stands beside them. `kf_attitude` is our linear filter "
        "beside the "
        "attitude packets (DMP: 0.010 rad of noise, put in); `kf as published` is (5.27)-(5.29) with "
        "(6.32), run on "
        "the same log: it has an attitude of its own. Table 6.2: its gains in [T]'s controller, with the "
        "sign of "
        "(6.13), the rates, the filters' frame and the feed-forward corrected.",
        differs="Fig. 6.14's bars are not printed as numbers. In [T] the EKF controls; here ours does, "
        "because the "
        "printed one does not hold the faster rates.",
        data=data,
    )
    for hz in YAW_HZ:
        case = case_name(hz)
        for name in COMPARED:
            what = f"{name}, {hz:g} Hz"
            result.add("Fig. 6.14", f"attitude RMSE, {what}", case, "attitude_rmse_rad", name, unit="rad")
            quantity = "yaw_frame_speed_rmse_m_s"
            result.add("Fig. 6.14", f"ball speed RMSE, {what}", case, quantity, name, unit="cm/s", scale=100)
        for name in ("ekf13_published", "ekf"):
            what = f"heading drift in {DURATION_S:.0f} s, {name}, {hz:g} Hz"
            result.add("Fig. 6.14", what, case, "heading_drift_rad", name, unit="rad")
    for hz in YAW_HZ:
        case = case_name(hz)
        if hz:
            text = f"{hz:g} Hz: the EKF's attitude is better than the KF's"
            over = (case, "attitude_rmse_rad", PUBLISHED_KF)
            result.check(
                "Fig. 6.14", text, case, "attitude_rmse_rad", "ekf13_published", at_most=1.0, over=over
            )
            result.check(
                "Fig. 6.14", text, case, "attitude_rmse_rad", "ekf13", at_most=1.0, over=over, claim="ours"
            )
        text = f"{hz:g} Hz: KF and EKF equal in ball speed within 10 %"
        target = "Fig. 6.14, KF and EKF equal in ball speed"
        pairs = (
            ("ekf13_published", PUBLISHED_KF, "[T]"),
            ("ekf13", "kf_attitude", "ours"),
            ("ekf", "kf_attitude", "ours"),
        )
        for first, second, claim in pairs:
            shown = text if claim == "[T]" else f"{text}: {first} against {second}"
            over = (case, "yaw_frame_speed_rmse_m_s", second)
            result.check(
                target,
                shown,
                case,
                "yaw_frame_speed_rmse_m_s",
                first,
                between=(0.9, 1.1),
                over=over,
                claim=claim,
            )
        text = f"{hz:g} Hz: the DMP's attitude errs less than the EKF's"
        over = (case, "attitude_rmse_rad", "ekf13_published")
        for target in ("Fig. 6.14", FIGURES[hz]):
            result.check(target, text, case, "attitude_rmse_rad", "kf_attitude", at_most=1.0, over=over)
        text = f"{hz:g} Hz: the EKF's attitude is close to the DMP's: its error within twice the DMP's"
        over = (case, "attitude_rmse_rad", "kf_attitude")
        result.check(
            FIGURES[hz], text, case, "attitude_rmse_rad", "ekf13_published", at_most=CLOSE, over=over
        )
        text = f"{hz:g} Hz: our EKF's attitude errs less than the DMP's"
        over = (case, "attitude_rmse_rad", "kf_attitude")
        result.check(
            FIGURES[hz], text, case, "attitude_rmse_rad", "ekf", at_most=1.0, over=over, claim="ours"
        )
        text = f"our EKF stays upright {DURATION_S:.0f} s at {hz:g} Hz in every run"
        result.check(FIGURES[hz], text, case, "held", "ekf", at_least=1.0, statistic="share", claim="ours")
    for world, claim in ((WORLD, "[T]"), ("nominal", "ours")):
        for name in IN_CONTROL:
            for hz in TABLE_6_2_HZ:
                case = table_case(world, name, hz)
                what = f"time upright at {hz:g} Hz, of {DURATION_S:.0f} s"
                result.add("Table 6.2", what, case, "upright_s", unit="s")
                text = f"the gains hold {hz:g} Hz in place, {world} world, every run"
                whose = claim if name == "ekf13_published" else "ours"
                result.check("Table 6.2", text, case, "held", at_least=1.0, statistic="share", claim=whose)
    draw(out_dir, data)
    labels = ("truth", "ekf13_published", "kf as published", "kf_attitude", "our EKF")
    result.pictures.append("estimation_accuracy")
    for hz, figure in FIGURES.items():
        name = figure.lower().replace(". ", "_").replace(".", "_")
        title = f"{figure}: in place at {hz:g} Hz, seed 1; last row: error of the attitude"
        timeplot.draw(out_dir / name, data, case_name(hz), labels, title, 20.0)
        result.pictures.append(name)
    return result


def draw(out_dir: Path, data: Data) -> None:
    at = np.array(sorted(YAW_HZ))
    with plt.rc_context(style.RC):
        figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
        for axes, quantity, scale in (
            (left, "attitude_rmse_rad", 1),
            (right, "yaw_frame_speed_rmse_m_s", 100),
        ):
            for i, name in enumerate(COMPARED):
                bands = [
                    np.percentile(scale * data.values(case_name(hz), quantity, name), (5, 50, 95))
                    for hz in at
                ]
                low, middle, high = np.array(bands).T
                axes.fill_between(at, low, high, color=style.colour(i), alpha=0.2, lw=0)
                axes.semilogy(at, middle, marker="o", color=style.colour(i), ls=style.dash(i), label=name)
        left.set(xlabel="yaw rate, Hz", ylabel="attitude RMSE, rad")
        right.set(xlabel="yaw rate, Hz", ylabel="ball speed RMSE, yaw frame, cm/s")
        style.legend_above(figure, left)
        style.save(figure, out_dir / "estimation_accuracy")
