"""Tables 4.4 and 4.5, Fig. 4.5: current of drive/coast motors, measured and predicted."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from .. import style
from ..style import plt
from .framework import Result
from .runs import equipoise, equipoise_json

COVERS = ("Table 4.4", "Table 4.5", "Fig. 4.5")
PWM_HZ = (500, 1000, 5000, 10000, 20000)
# (motor, driver) -> values over PWM_HZ.
R2_COAST = {
    (1, 1): (0.964, 0.969, 0.980, 0.964, 0.962),
    (1, 2): (0.971, 0.973, 0.973, 0.650, 0.937),
    (1, 3): (0.987, 0.986, 0.984, 0.972, 0.964),
    (2, 1): (0.982, 0.985, 0.982, 0.980, 0.973),
    (2, 2): (0.979, 0.979, 0.973, 0.968, 0.959),
    (2, 3): (0.986, 0.985, 0.984, 0.982, 0.973),
    (3, 1): (0.962, 0.967, 0.949, 0.944, 0.929),
    (3, 2): (0.965, 0.959, 0.929, 0.902, 0.865),
    (3, 3): (0.982, 0.974, 0.965, 0.954, 0.913),
}
R2_LINEAR = {
    (1, 1): (0.753, 0.746, 0.642, 0.470, 0.413),
    (2, 1): (0.841, 0.844, 0.740, 0.628, 0.516),
    (3, 1): (0.783, 0.713, 0.358, 0.315, 0.244),
}
RMSE_COAST = {
    (1, 1): (7.72, 6.70, 5.12, 5.44, 6.48),
    (1, 2): (6.95, 6.61, 5.76, 6.16, 7.69),
    (1, 3): (4.58, 4.65, 4.38, 5.47, 5.98),
    (2, 1): (6.16, 5.56, 5.39, 5.33, 5.93),
    (2, 2): (6.33, 6.41, 6.46, 6.50, 6.92),
    (2, 3): (5.16, 5.07, 4.85, 4.75, 5.65),
    (3, 1): (7.69, 6.73, 7.57, 7.89, 8.78),
    (3, 2): (5.25, 5.70, 6.27, 7.62, 11.4),
    (3, 3): (6.88, 6.82, 7.88, 8.89, 10.1),
}
RMSE_LINEAR = {
    (1, 1): (20.3, 20.1, 21.9, 23.9, 25.6),
    (2, 1): (18.5, 17.9, 20.6, 22.9, 25.2),
    (3, 1): (18.4, 20.0, 26.7, 27.6, 28.6),
}


def mean(rows: list[dict], model: str, key: str) -> float:
    return float(np.mean([row[model][key] for row in rows]))


def run(out_dir: Path) -> Result:
    result = Result(
        title="Drive/coast model on the motor bench (Tables 4.4, 4.5, Fig. 4.5)",
        command="equipoise motor-bench --json -",
        method="The bench of [T] 4.5.1 at PWM resolution: motor with back-EMF and flywheel, bridge with "
        "diode drop, "
        "switch resistance and delays, current sensor with its window and counts; sine chirp, ramping "
        "chirp, random "
        "walk. Predicted currents come from the logged command, supply and flywheel angle alone.",
        differs="our motors obey the bridge's equations and their parameters are known exactly; [T]'s "
        "parameters are "
        "identified and its flywheel, amplitudes and sensor settings are not printed, so ours are chosen.",
    )
    rows = equipoise_json("motor-bench")["rows"]
    for row in rows:
        key = row["motor"], row["driver"]
        at = PWM_HZ.index(int(row["pwm_hz"]))
        label = f"motor {key[0]}, driver {key[1]}, {int(row['pwm_hz'])} Hz"
        for model, r2, rmse in (("drive_coast", R2_COAST, RMSE_COAST), ("linear", R2_LINEAR, RMSE_LINEAR)):
            printed_r2, printed_rmse = r2.get(key), rmse.get(key)
            name = model.replace("_", "/")
            result.add(
                "Table 4.4", f"R² {name}, {label}", row[model]["r_squared"], printed_r2 and printed_r2[at]
            )
            result.add(
                "Table 4.5",
                f"RMSE {name}, {label}",
                100 * row[model]["rmse_over_stall"],
                printed_rmse and printed_rmse[at],
                "% of stall",
            )
    coast, linear = mean(rows, "drive_coast", "r_squared"), mean(rows, "linear", "r_squared")
    result.add("Table 4.4", "mean R² drive/coast", coast, float(np.mean(list(R2_COAST.values()))))
    result.add("Table 4.4", "mean R² linear", linear, float(np.mean(list(R2_LINEAR.values()))))
    result.check("Table 4.4", "mean R² of the drive/coast model at least 0.97", coast >= 0.97)
    result.check("Table 4.4", "mean R² of the linear model at most 0.75", linear <= 0.75)
    worst = min(row["drive_coast"]["r_squared"] - row["linear"]["r_squared"] for row in rows)
    result.check("Table 4.4", "drive/coast beats linear in every cell", worst > 0)
    of_driver_1 = [row for row in rows if row["driver"] == 1]
    falls = all(
        row["linear"]["r_squared"] > other["linear"]["r_squared"]
        for row in of_driver_1
        for other in of_driver_1
        if row["motor"] == other["motor"] and row["pwm_hz"] == 500 and other["pwm_hz"] == 20000
    )
    result.check("Table 4.4", "the linear model is worse at 20 kHz than at 500 Hz, each motor", falls)
    rmse = mean(rows, "drive_coast", "rmse_over_stall"), mean(rows, "linear", "rmse_over_stall")
    result.add("Table 4.5", "mean RMSE drive/coast", 100 * rmse[0], 6.5, "% of stall")
    result.add("Table 4.5", "mean RMSE linear", 100 * rmse[1], 22.5, "% of stall")
    result.check("Table 4.5", "the linear model errs at least three times as much", rmse[1] > 3 * rmse[0])
    draw(out_dir)
    shown = next(row for row in rows if (row["motor"], row["driver"], row["pwm_hz"]) == (1, 1, 20000))
    follows = shown["drive_coast"]["r_squared"] > 0.95 > 0.6 > shown["linear"]["r_squared"]
    result.check("Fig. 4.5", "drive/coast follows the current (R² > 0.95), linear does not (< 0.6)", follows)
    result.pictures.append("motor_bench.png")
    return result


def draw(out_dir: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.csv"
        equipoise("motor-bench", "--motor", 1, "--driver", 1, "--pwm-hz", 20000, "--trace", trace)
        data = np.genfromtxt(trace, delimiter=",", names=True)
    with plt.rc_context(style.RC):
        figure, rows = plt.subplots(3, 1, figsize=(9, 7), layout="constrained")
        for axes, start, name in zip(
            rows, (0, 25, 45), ("sine chirp", "ramping chirp", "random walk"), strict=True
        ):
            shown = (data["t_s"] >= start) & (data["t_s"] < start + 8)
            t = data["t_s"][shown]
            axes.plot(t, data["linear_A"][shown], color=style.REFERENCE, label="linear model")
            axes.plot(t, data["current_A"][shown], color=style.TRUTH, lw=1.6, label="measured")
            axes.plot(
                t, data["drive_coast_A"][shown], color=style.ESTIMATE, ls="--", label="drive/coast model"
            )
            axes.set(ylabel="current, A", title=name)
        rows[0].legend(ncols=3)
        rows[-1].set_xlabel("time, s")
        figure.savefig(out_dir / "motor_bench.png")
        plt.close(figure)
