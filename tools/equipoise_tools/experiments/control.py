"""6.3.2, 6.4.5, 6.4.6: spin and drive at once, by the EKF and by DMP+KF (Fig. 6.6, 6.25-6.32, Table 6.3)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from equipoise_robot.log import Log

from .. import metrics, names, published, style
from ..style import plt
from . import timeplot
from .data import Data
from .framework import Result
from .runs import AS_PUBLISHED, BUILT, MBBR, NO_GATES, Case

CONDITIONS = ((0.5, 0.20), (0.75, 0.15), (1.0, 0.10), (1.5, 0.05))
EKF_FIGURES = tuple(f"Fig. 6.{n}" for n in range(25, 29))
KF_FIGURES = tuple(f"Fig. 6.{n}" for n in range(29, 33))
COVERS = ("Fig. 6.6", "Table 6.3", *EKF_FIGURES, *KF_FIGURES, "6.4.6, DMP+KF outlasts the EKF")
DURATION_S = 60.0
WORLDS = (BUILT, "nominal")
TABLE_6_3 = published.gains("Table 6.3")
RAN = {  # label: controller, filter, settings
    "all as published": ("thesis", "ekf13_published", {**AS_PUBLISHED, **TABLE_6_3}),
    "published EKF": ("thesis", "ekf13_published", TABLE_6_3),
    "DMP+KF as published": ("thesis", "kf_attitude", {**published.kf(), **AS_PUBLISHED, **TABLE_6_3}),
    "published DMP+KF": ("thesis", "kf_attitude", {**published.kf(), **TABLE_6_3}),
    "our DMP+KF": ("thesis", "kf_attitude", TABLE_6_3),
    "our EKF": ("thesis", "ekf", TABLE_6_3),
    "ours": ("scheduled", "ekf", {}),
}
OF_T = {  # labels whose filter is [T]'s
    "all as published": EKF_FIGURES,
    "published EKF": EKF_FIGURES,
    "DMP+KF as published": KF_FIGURES,
    "published DMP+KF": KF_FIGURES,
}
FULL_ONLY = ("all as published", "DMP+KF as published")
TRACED = {"published EKF": EKF_FIGURES, "published DMP+KF": KF_FIGURES}
POSITION_WITHIN_M = 0.05  # "almost exactly": a twentieth of a metre


def said(condition: tuple[float, float]) -> str:
    return f"{condition[0]:g} Hz and {100 * condition[1]:.0f} cm/s"


def case_name(world: str, label: str, condition: tuple[float, float]) -> str:
    return f"{world}, {label}, {said(condition)}"


def tracking(log: Log, summary: dict) -> dict:
    """How far the estimated position, which is controlled, and the true one are from the reference, and the
    heading from its own; after 5 s."""
    if summary["ended"] != "finished":
        return {("", "tracking_rmse_m"): np.nan, ("", "heading_tracking_rmse_rad"): np.nan}
    reference, estimate = metrics.aligned(log, names.REFERENCE, names.STATE)
    settled = (reference["utime"] - log.start_utime) * 1e-6 >= metrics.SETTLE_S
    off = (estimate["position_W_m"] - reference["position_W_m"])[settled]
    heading = metrics.wrapped(estimate["theta_rad"][:, 2] - reference["theta_rad"][:, 2])[settled]
    return {
        ("", "tracking_rmse_m"): metrics.rms(off),
        ("", "heading_tracking_rmse_rad"): metrics.rms(heading),
    }


def trace(log: Log) -> dict:
    return timeplot.series_of(log, timeplot.channels("estimate"))


def cases() -> list[Case]:
    found = []
    for world in WORLDS:
        for label, (controller, filter_name, sets) in RAN.items():
            if label in FULL_ONLY and world != BUILT:
                continue
            for hz, drive in CONDITIONS:
                options = {
                    "yaw_hz": hz, "drive_mps": drive, "controller": controller, "estimator": filter_name,
                    "duration_s": DURATION_S, "fidelity": world,
                }  # fmt: skip
                traced = trace if world == BUILT and label in TRACED else None
                name = case_name(world, label, (hz, drive))
                settings = {**NO_GATES, **sets}
                found.append(
                    Case(
                        name, MBBR, settings, options,
                        section="(6.31)" if filter_name == "ekf13_published" else "",
                        gains="[T] Table 6.3" if controller == "thesis" else "",
                        measure=tracking if traced else None, trace=traced, trace_s=(0.0, 25.0),
                    )
                )  # fmt: skip
    options = {"yaw_hz": 1.0, "drive_mps": 0.20, "fidelity": "thesis", "duration_s": 20.0}
    thesis = {**options, "controller": "thesis"}
    found += [
        Case(
            "simulation (6.22)",
            sets={**NO_GATES, **AS_PUBLISHED, **published.gains("(6.22)")},
            options={**thesis, "estimator": "ekf13_published"},
            section="(6.21)",
            gains="[T] (6.22)",
        ),
        Case(
            "simulation, corrected",
            sets={**NO_GATES, **TABLE_6_3},
            options={**thesis, "estimator": "ekf"},
            gains="[T] Table 6.3",
        ),
        Case("simulation, ours", sets=NO_GATES, options=options, trace=trace, trace_s=(0.0, 20.0)),
    ]
    return found


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Spinning and driving at once (Fig. 6.6, 6.25-6.32, Table 6.3)",
        command="equipoise sim --config config/mbbr.toml --fidelity built2025 --controller thesis "
        "--estimator ekf13_published --yaw-hz 1 --drive-mps 0.1 --duration-s 60",
        method=f"Four conditions, {DURATION_S:.0f} s, the built robot (built2025 world); the nominal world "
        "beside it. `as published`: filter with its section's noise, (6.13) with its sign, Euler-angle "
        "rates, filters in the yaw frame, no feed-forward, commands without an acceleration limit, all "
        "from config/published.toml. `published EKF` and `published DMP+KF`: the same, controller corrected "
        "(sign turned, body rates, inertial filters, back-EMF fed forward, our acceleration limit). `our "
        "DMP+KF`: our linear filter, which turns with the frame, beside the same attitude packets (0.010 rad "
        "of noise). `our EKF`: the same corrected controller and gains. `ours`: our EKF and scheduled gains. "
        "Fig. 6.6: [T]'s own simulation (thesis world: friction, linear motors, the filter's noise), 20 s. "
        "Our safety gates are open.",
        differs="our worlds are not [T]'s robot: where its robot stood the published filter falls here. Its "
        "model lacks the transport of the ball's rate by the spin. (6.22) is unstable in any version of the "
        "linear model (published_gains).",
        data=data,
    )
    for world in WORLDS:
        for label in RAN:
            for condition in CONDITIONS:
                case = case_name(world, label, condition)
                if label in FULL_ONLY and world != BUILT:
                    continue
                target = OF_T.get(label, KF_FIGURES if "KF" in label else EKF_FIGURES)[
                    CONDITIONS.index(condition)
                ]
                what = f"{label}, {said(condition)}"
                result.add(target, f"time upright of {DURATION_S:.0f} s, {what}", case, "upright_s", unit="s")
                result.add(target, f"share of runs upright to the end, {what}", case, "held")
                result.add(target, f"attitude RMSE, {what}", case, "attitude_rmse_rad", unit="rad")
                quantity = "yaw_frame_speed_rmse_m_s"
                result.add(
                    target, f"ball speed RMSE, yaw frame, {what}", case, quantity, unit="cm/s", scale=100
                )
                result.add(target, f"heading error at the end, {what}", case, "heading_error_rad", unit="rad")
    for i, condition in enumerate(CONDITIONS):
        for world in WORLDS:
            check_held(result, i, condition, world)
        for label, figures in TRACED.items():
            check_tracking(result, figures[i], case_name(BUILT, label, condition), said(condition))
    last = CONDITIONS[-1]
    text = f"the EKF loses balance at {said(last)}, about 8 s in (6 to 12 s)"
    for label in ("all as published", "published EKF", "our EKF"):
        claim = "[T]" if label in OF_T else "ours"
        case = case_name(BUILT, label, last)
        result.check(EKF_FIGURES[-1], text, case, "upright_s", between=(6.0, 12.0), claim=claim)
    target = "6.4.6, DMP+KF outlasts the EKF"
    for label in ("DMP+KF as published", "published DMP+KF", "our DMP+KF"):
        claim = "[T]" if label in OF_T else "ours"
        case = case_name(BUILT, label, last)
        share = {"statistic": "share", "at_least": 1.0}
        result.check(target, f"DMP+KF holds {said(last)}, every run", case, "held", claim=claim, **share)
        text = f"DMP+KF stays up longer than the published EKF at {said(last)}, by half or more"
        over = (case_name(BUILT, "published EKF", last), "upright_s", "ekf13_published")
        result.check(target, text, case, "upright_s", at_least=1.5, over=over, claim=claim)
    text = "the gains (6.22) hold 1 Hz and 20 cm/s for 20 s, every run"
    result.check("Fig. 6.6", text, "simulation (6.22)", "held", at_least=1.0, statistic="share", derived=True)
    for case, words in (
        ("simulation, corrected", "Table 6.3, our EKF"),
        ("simulation, ours", "scheduled, our EKF"),
    ):
        text = f"{words}: 1 Hz and 20 cm/s for 20 s, every run"
        result.check("Fig. 6.6", text, case, "held", at_least=1.0, statistic="share", claim="ours")
    for case in ("simulation (6.22)", "simulation, corrected", "simulation, ours"):
        result.add("Fig. 6.6", f"time upright of 20 s, {case}", case, "upright_s", unit="s")
        result.add("Fig. 6.6", f"position RMSE, {case}", case, "position_rmse_m", unit="m")
    draw(out_dir, data)
    result.pictures.append("control")
    labels = ("truth", "reference", "estimate")
    title = "Fig. 6.6: thesis world, 1 Hz and 20 cm/s, our EKF and scheduled gains, seed 1"
    timeplot.draw(out_dir / "fig_6_6", data, "simulation, ours", labels, title)
    result.pictures.append("fig_6_6")
    for label, targets in TRACED.items():
        for target, condition in zip(targets, CONDITIONS, strict=True):
            name = target.lower().replace(". ", "_").replace(".", "_")
            title = f"{target}: {said(condition)}, built2025 world, {label}, Table 6.3; seed 1"
            timeplot.draw(out_dir / name, data, case_name(BUILT, label, condition), labels, title)
            result.pictures.append(name)
    return result


def check_held(result: Result, i: int, condition: tuple[float, float], world: str) -> None:
    share = {"statistic": "share", "at_least": 1.0}
    words = said(condition)
    for label in RAN:
        if label in FULL_ONLY and world != BUILT:
            continue
        case = case_name(world, label, condition)
        claim = "[T]" if label in OF_T and world == BUILT else "ours"
        falls = EKF_FIGURES[i] == "Fig. 6.28" and OF_T.get(label) == EKF_FIGURES  # there it falls in [T], too
        if label != "ours" and not falls:
            text = f"the gains of Table 6.3 hold {words}, {world} world, every run"
            result.check("Table 6.3", text, case, "held", claim=claim, **share)
        if label == "ours":
            text = f"our EKF with scheduled gains holds {words}, {world} world, every run"
            for figure in (EKF_FIGURES[i], KF_FIGURES[i]):
                result.check(figure, text, case, "held", claim=claim, **share)
        elif not falls:
            kf = "KF" in label and "EKF" not in label
            text = f"{'DMP+KF' if kf else 'the EKF'} holds {words}, {world} world, every run"
            result.check((KF_FIGURES if kf else EKF_FIGURES)[i], text, case, "held", claim=claim, **share)


def check_tracking(result: Result, figure: str, case: str, words: str) -> None:
    """ "The controller seems to track the ball position reference almost exactly", of the estimate, 6.4.5."""
    result.add(
        figure, f"estimated position against its reference, {words}", case, "tracking_rmse_m", unit="m"
    )
    what = f"estimated heading against its reference, {words}"
    result.add(figure, what, case, "heading_tracking_rmse_rad", unit="rad")
    text = f"{words}: the estimated position follows its reference within {POSITION_WITHIN_M} m RMS"
    result.check(figure, text, case, "tracking_rmse_m", at_most=POSITION_WITHIN_M)


def draw(out_dir: Path, data: Data) -> None:
    with plt.rc_context(style.RC):
        figure, panels = plt.subplots(1, 2, figsize=(10, 3.8), sharey=True, layout="constrained")
        for axes, world in zip(panels, WORLDS, strict=True):
            for i, label in enumerate(RAN):
                if label in FULL_ONLY and world != BUILT:
                    continue
                shown = [
                    np.percentile(data.values(case_name(world, label, c), "upright_s"), (5, 50, 95))
                    for c in CONDITIONS
                ]
                low, middle, high = np.array(shown).T
                at = np.arange(len(CONDITIONS)) + 0.08 * (i - 3)
                axes.errorbar(
                    at,
                    middle,
                    [middle - low, high - middle],
                    fmt="o",
                    color=style.colour(i),
                    label=label,
                    capsize=2,
                )
            axes.set(title=f"{world} world", xticks=range(len(CONDITIONS)), yscale="log")
            axes.set_xticklabels([said(c).replace(" and ", "\n") for c in CONDITIONS])
        panels[0].set_ylabel(f"time upright of {DURATION_S:.0f} s")
        style.legend_above(figure, panels[0])
        style.save(figure, out_dir / "control")
