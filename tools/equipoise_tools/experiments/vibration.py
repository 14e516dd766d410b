"""6.4.4: vibration of the ball over drive speed, by the rollers' rows taking turns (Fig. 6.24)."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from .. import metrics, mocap, names, style
from ..style import plt
from .framework import Result
from .runs import equipoise_json, simulate

COVERS = ("Fig. 6.24",)
DRIVE_MPS = (0.05, 0.10, 0.15, 0.20)
WHEEL_RADIUS_M, ROLLERS = 0.0125, 12
ALPHA_DEG, AZIMUTH_DEG = 60.0, -140.0
ROLLER_TILT_RAD = 0.094  # (2.1): rows 6 mm apart


def run(out_dir: Path) -> Result:
    result = Result(
        title="Vibration over drive speed (Fig. 6.24)",
        command="equipoise sim --config config/mbbr.toml --drive-mps 0.2 "
        f"--set world.nominal.disturbance.roller_tilt_rad={ROLLER_TILT_RAD}",
        method="The robot drives without spin at four speeds; the rows of its double-row wheels take turns, "
        "each turning the wheel's torque axis (2.1). Spectrum of the ball's true rate.",
        differs="at 20 cm/s rollers pass our wheels at 68 to 156 rad/s: [T]'s 17-25 rad/s is not this rate "
        "but near that of the wheels themselves (6 to 13 rad/s) and its harmonics.",
    )
    spectra(out_dir / "vibration.png", result)
    result.pictures.append("vibration.png")
    return result


def passing_rate(drive_mps: float) -> float:
    """Rollers of a row that pass the fastest wheel's contact, rad/s, when the robot drives along x."""
    T_ob = equipoise_json("geometry", "--alpha-deg", ALPHA_DEG, "--azimuth-deg", AZIMUTH_DEG)["T_ob"]
    return ROLLERS * drive_mps / WHEEL_RADIUS_M * max(map(abs, T_ob[1]))  # the ball rolls about y


def line(omega: np.ndarray, amplitude: np.ndarray, expected: float) -> tuple[float, float]:
    """(rad/s, height over the floor) of the strongest line within 10 % of where it should be."""
    near = np.abs(omega / expected - 1) < 0.10
    around = (np.abs(omega / expected - 1) < 0.5) & ~near
    at = np.flatnonzero(near)[np.argmax(amplitude[near])]
    return float(omega[at]), float(amplitude[at] / np.median(amplitude[around]))


def spectra(path: Path, result: Result) -> None:
    """Where the ball's true speed vibrates, over drive speed."""
    found = []
    with plt.rc_context(style.RC):
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        for i, drive in enumerate(DRIVE_MPS):
            _, log = simulate(
                drive_mps=drive,
                duration_s=30,
                sets={"world.nominal.disturbance.roller_tilt_rad": ROLLER_TILT_RAD},
            )
            t_s = log.seconds(names.TRUTH)
            settled = t_s >= metrics.SETTLE_S
            rate = metrics.rolling_rates(log[names.TRUTH], 2)[settled]
            omega, first = mocap.spectrum(t_s[settled], rate[:, 0])
            _, second = mocap.spectrum(t_s[settled], rate[:, 1])
            amplitude = np.hypot(first, second)
            axes.semilogy(omega, amplitude, color=style.colour(i), label=f"{100 * drive:.0f} cm/s")
            at, height = line(omega, amplitude, passing_rate(drive))
            found.append((drive, at, height))
            what = f"line near the fastest wheel's roller passing rate, {100 * drive:.0f} cm/s"
            result.add("Fig. 6.24", what, at, None, "rad/s")
            result.add("Fig. 6.24", f"that rate, {100 * drive:.0f} cm/s", passing_rate(drive), None, "rad/s")
            result.add("Fig. 6.24", f"{what}, over the floor", height)
        axes.set(xlim=(0, 250), xlabel="rad/s", ylabel="true ball rate, rad/s", title="Drive without spin")
        axes.legend(loc="upper right")
        figure.savefig(path)
        plt.close(figure)
    stands_out = all(height > 3 for _, _, height in found)
    result.check(
        "Fig. 6.24",
        "the ball vibrates at the fastest wheel's roller passing rate at every drive speed",
        stands_out,
    )
    rising = all(a[1] < b[1] for a, b in itertools.pairwise(found))
    result.check("Fig. 6.24", "that line's frequency rises with the drive speed", rising)
