"""6.3.1, 6.4.2: the published EKF over-estimates the ball's speed (Fig. 6.4, 6.5, 6.8)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from equipoise_robot.log import Log

from .. import metrics, names, published, style
from ..style import plt
from .data import TRACE_HZ, Data
from .framework import Result
from .runs import BUILT, NO_GATES, Case, over_estimate

COVERS = ("Fig. 6.4", "Fig. 6.5", "Fig. 6.5, with compensation", "Fig. 6.8")
PUBLISHED, CORRECTED = "ekf13_published", "ekf13"  # the same states; the model as published, and corrected
CHANNEL = names.STATE + "_EKF13_PUBLISHED"
WORLDS = {"Fig. 6.4": "thesis", "Fig. 6.5": BUILT}
SECTION = {"thesis": "(6.21)", BUILT: "(6.26)"}
GAINS = (0.0, published.table()["6.2.2"]["compensation"])
DURATION_S = 60.0
MU_C_OVER_K1 = published.table()["6.2.2"]["mu_c_over_k1"]
PREDICTION = "prediction (5.33)"


def case_name(world: str, gain: float) -> str:
    return f"{world}, compensation {gain:g}"


def predicted(log: Log) -> tuple[np.ndarray, np.ndarray]:
    """Accelerometer x as (5.33) predicts it in place: with the input before compensation, and with Coulomb
    friction in the model, [T] 6.4.2."""
    state, motors = log[CHANNEL], log[names.MOTORS]
    theta, rate = state["theta_rad"][:, 1], state["omega_B_rad_s"][:, 1]
    speed = state["phi_dot_rad_s"][:, 1]
    u = np.concatenate([[0.0], motors["u_lin"][:-1, 1]])[: theta.size]
    plain = -4.6 * theta + 0.5 * rate - 0.5 * speed + 7.8 * u
    return plain, plain - 7.8 * MU_C_OVER_K1 * np.sign(speed - rate)


def quantities(log: Log, summary: dict) -> dict:
    found = {(PUBLISHED, "over_estimate"): over_estimate(log, CHANNEL)}
    found[CORRECTED, "over_estimate"] = over_estimate(log, f"{names.STATE}_{CORRECTED.upper()}")
    settled = log.seconds(CHANNEL) >= metrics.SETTLE_S
    for name, values in zip(("plain", "with_friction"), predicted(log), strict=True):
        jumps = np.abs(np.diff(values[settled]))
        found[PREDICTION, f"prediction_jump_{name}_m_s2"] = float(jumps.max()) if jumps.size else np.nan
    return found


def trace(log: Log) -> dict:
    radius_m = metrics.run_record(log).rolling_radius_m
    found = {}
    for label, channel in (("truth", names.TRUTH), ("published EKF", CHANNEL)):
        rates = 100 * radius_m * metrics.rolling_rates(log[channel], 2)
        found[label] = log.seconds(channel), rates[:, 0]
    for label, values in zip(("plain", "with friction"), predicted(log), strict=True):
        found[label] = log.seconds(CHANNEL), values
    found["measured"] = log.seconds(names.SENSORS), -9.8 / 4096 * log[names.SENSORS]["accel_counts"][:, 0]
    return found


def cases() -> list[Case]:
    return [
        Case(
            case_name(world, gain),
            sets={"friction.compensation": gain, **NO_GATES},
            options={"fidelity": world, "compare": True, "duration_s": DURATION_S},
            section=SECTION[world],
            measure=quantities,
            trace=trace,
            trace_s=(10.0, 20.0),
        )
        for world in WORLDS.values()
        for gain in GAINS
    ]


def report(data: Data, out_dir: Path) -> Result:
    result = Result(
        title="Friction compensation (Fig. 6.4, 6.5, 6.8)",
        command="equipoise sim --config config/mbbr.toml --fidelity built2025 --compare --duration-s 60 "
        "--set friction.compensation=0",
        method="The robot balances in place with and without Coulomb compensation; our EKF controls, the "
        "published EKF, noise of (6.21) in the thesis world and of (6.26) in the built2025 world, runs on "
        "the same samples. Over-estimate: slope of the estimated ball rate on the true one. Fig. 6.8: the "
        "accelerometer that (5.33) predicts from the published EKF, without and with Coulomb friction "
        "(0.30 sign) in the model; jump: its largest change in a tick. It is the friction term itself: "
        "the finding follows from the formula.",
        differs="[T] gives 1.5 to 2, elsewhere 2.5, and controls with the published filter. Beside it on the "
        "same samples: the corrected model (ekf13: 502 for 410, transport, noise on the torques).",
        data=data,
    )
    for figure, world in WORLDS.items():
        for gain in GAINS:
            case = case_name(world, gain)
            what = f"over-estimate at compensation {gain:g}"
            result.add(figure, what, case, "over_estimate", PUBLISHED, None if gain else 2.0)
            result.add(figure, f"{what}, corrected model", case, "over_estimate", CORRECTED)
            text = f"{world} world: upright at compensation {gain:g}, every run"
            result.check(figure, text, case, "held", "ekf", at_least=1.0, statistic="share", claim="ours")
        without, with_it = case_name(world, GAINS[0]), case_name(world, GAINS[1])
        text = f"{world} world: without compensation 1.5 to 2.5 times too fast"
        result.check(figure, text, without, "over_estimate", PUBLISHED, between=(1.5, 2.5))
        text = f"{world} world: compensation takes it down by a third or more"
        over = (without, "over_estimate", PUBLISHED)
        result.check(figure, text, with_it, "over_estimate", PUBLISHED, at_most=2 / 3, over=over)
        text = f"{world} world: with compensation the speed is right within 25 %"
        words = f"{text}, corrected model"
        result.check(figure, words, with_it, "over_estimate", CORRECTED, between=(0.75, 1.25),
                     claim="ours")  # fmt: skip
        target = "Fig. 6.5, with compensation" if world == BUILT else figure
        claim = "[T]" if world == BUILT else "ours"
        result.check(target, text, with_it, "over_estimate", PUBLISHED, between=(0.75, 1.25), claim=claim)
    case = case_name(BUILT, GAINS[1])
    for name in ("plain", "with_friction"):
        quantity = f"prediction_jump_{name}_m_s2"
        result.add(
            "Fig. 6.8",
            f"jump of the predicted accelerometer, {name}",
            case,
            quantity,
            PREDICTION,
            unit="m/s²",
        )
    text = "Coulomb friction in the model makes the predicted accelerometer jump twice as much or more"
    over = (case, "prediction_jump_plain_m_s2", PREDICTION)
    result.check(
        "Fig. 6.8", text, case, "prediction_jump_with_friction_m_s2", PREDICTION, at_least=2.0, over=over
    )
    draw(out_dir, data)
    result.pictures += ["friction_compensation", "fig_6_8"]
    return result


def draw(out_dir: Path, data: Data) -> None:
    with plt.rc_context(style.RC):
        figure, rows = plt.subplots(2, 2, figsize=(10, 5), layout="constrained", sharex=True, sharey="row")
        for row, world in zip(rows, WORLDS.values(), strict=True):
            for axes, gain in zip(row, GAINS, strict=True):
                case = case_name(world, gain)
                for label, colour in (("published EKF", style.ESTIMATE), ("truth", style.TRUTH)):
                    values = data.trace(case, label)
                    axes.plot(10 + np.arange(values.size) / TRACE_HZ, values, color=colour, label=label)
                axes.set(title=f"{world} world, compensation {gain:g}")
            row[0].set_ylabel("ball speed, cm/s")
        for axes in rows[1]:
            axes.set_xlabel("time, s")
        style.legend_above(figure, rows[0, 0])
        style.save(figure, out_dir / "friction_compensation")
        figure, rows = plt.subplots(2, 1, figsize=(9, 4.5), layout="constrained", sharex=True, sharey=True)
        case = case_name(BUILT, GAINS[1])
        for axes, label in zip(rows, ("plain", "with friction"), strict=True):
            measured = data.trace(case, "measured")
            t_s = 10 + np.arange(measured.size) / TRACE_HZ
            axes.plot(t_s, measured, color="#999999", lw=0.8, label="measured")
            axes.plot(t_s, data.trace(case, label), color=style.ESTIMATE, label="predicted")
            axes.set(ylabel="accelerometer x, m/s²", title=f"(5.33), {label}")
        axes.set_xlabel("time, s")
        style.legend_above(figure, rows[0])
        style.save(figure, out_dir / "fig_6_8")
