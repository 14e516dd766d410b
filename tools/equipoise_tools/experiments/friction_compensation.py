"""6.3.1, 6.4.2: the printed EKF over-estimates the ball's speed without compensation (Fig. 6.4, 6.5, 6.8)."""

from __future__ import annotations

from pathlib import Path

from .. import metrics, names, style
from ..style import plt
from .framework import Result
from .runs import over_estimate, simulate

COVERS = ("Fig. 6.4", "Fig. 6.5", "Fig. 6.8")
PRINTED = names.STATE + "_EKF13_PUBLISHED"


def run(out_dir: Path) -> Result:
    result = Result(
        title="Friction compensation (Fig. 6.4, 6.5, 6.8)",
        command="equipoise sim --config config/mbbr.toml --fidelity thesis --compare --duration-s 25 "
        "--set friction.compensation=0",
        method="The robot balances in place with and without Coulomb compensation; the corrected EKF "
        "controls, the printed EKF watches. Over-estimate: slope of the estimated ball rate on the true one.",
        differs="[T] gives 1.5 to 2, elsewhere 2.5; ours also holds what the printed 410 for 502 adds, "
        "and the process noise of the simulation is not the robot's.",
    )
    runs = {}
    for figure, fidelity in (("Fig. 6.4", "thesis"), ("Fig. 6.5", "nominal")):
        slopes = {}
        for gain in (0.0, 1.1):
            summary, log = simulate(
                sets={"friction.compensation": gain}, fidelity=fidelity, compare=True, duration_s=25
            )
            runs[fidelity, gain] = log
            slopes[gain] = over_estimate(log, PRINTED)
            result.check(figure, f"upright at compensation {gain}", not summary["fell"])
            result.add(figure, f"over-estimate at compensation {gain:g}", slopes[gain], None if gain else 2.0)
        result.check(figure, "without compensation at least 1.5 times too fast", slopes[0.0] >= 1.5)
        if fidelity == "thesis":
            result.check(figure, "compensation removes it (below 1.5)", slopes[1.1] < 1.5)
        result.check(
            figure,
            "compensation takes away more than half of the excess",
            2 * (slopes[1.1] - 1) < slopes[0.0] - 1,
        )
    draw(out_dir, runs)
    innovation = {}
    for gain in (0.0, 1.1):
        records = runs["nominal", gain][PRINTED]
        innovation[gain] = float(records["normalized_innovation"][1000:].mean())
        result.add("Fig. 6.8", f"mean normalised innovation, compensation {gain:g}", innovation[gain])
    result.check(
        "Fig. 6.8",
        "sensors agree better with their prediction when friction is compensated",
        innovation[1.1] < innovation[0.0],
    )
    result.pictures.append("friction_compensation.png")
    return result


def draw(out_dir: Path, runs: dict) -> None:
    with plt.rc_context(style.RC):
        figure, rows = plt.subplots(2, 2, figsize=(10, 5), layout="constrained", sharex=True)
        for (fidelity, gain), log in runs.items():
            axes = rows[int(fidelity == "nominal"), int(gain > 0)]
            for channel, colour, name in (
                (PRINTED, style.ESTIMATE, "printed EKF"),
                (names.TRUTH, style.TRUTH, "truth"),
            ):
                axes.plot(
                    log.seconds(channel),
                    metrics.rolling_rates(log[channel], 2)[:, 0],
                    color=colour,
                    label=name,
                )
            axes.set(title=f"{fidelity}, compensation {gain:g}", xlim=(10, 16), ylabel="ball rate x, rad/s")
        rows[0, 0].legend(ncols=2)
        for axes in rows[1]:
            axes.set_xlabel("time, s")
        figure.savefig(out_dir / "friction_compensation.png")
        plt.close(figure)
