"""Picture of a design: loop gain and phase, Nyquist curve and margins over yaw rate, from `equipoise design`.

equipoise design --config F --bode --json - | python3 -m equipoise_tools.design --output design.png
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from .style import plt

PLACES = {"u": "at u", "gyro": "at the gyro", "encoder": "at the encoders"}
WANTED = {"gain_dB": 6.0, "delay_ms": 6.0, "phase_deg": {"u": 40.0, "gyro": 40.0, "encoder": 35.0}}


def loop(row: dict, place: str) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in rad/s and L."""
    pairs = np.array(row["loop"][place])
    return np.array(row["omega_rad_s"]), pairs[:, 0] + 1j * pairs[:, 1]


def margin(row: dict, place: str, name: str) -> float:
    value = row["margins"][place][name]
    return np.inf if value is None else abs(value)


def draw_bode(gain: plt.Axes, phase: plt.Axes, row: dict) -> None:
    for place, label in PLACES.items():
        omega, L = loop(row, place)
        keep = omega > 0.5
        gain.semilogx(omega[keep], 20 * np.log10(np.abs(L[keep])), label=label)
        phase.semilogx(omega[keep], np.degrees(np.angle(-L[keep])))
    gain.axhline(0, color="0.6", lw=0.8)
    phase.axhline(0, color="0.6", lw=0.8)
    gain.set_ylabel("|L|, dB")
    phase.set_ylabel("phase from -1, degrees")
    phase.set_xlabel("rad/s")
    gain.legend()


def draw_nyquist(axes: plt.Axes, row: dict) -> None:
    for place in PLACES:
        L = loop(row, place)[1]
        inside = np.where(np.abs(L) < 6, L, np.nan)
        axes.plot(inside.real, inside.imag)
    axes.plot(-1, 0, "k+")
    axes.set_xlim(-4, 2)
    axes.set_ylim(-3, 3)
    axes.set_aspect("equal")
    axes.set_xlabel("Re L")
    axes.set_ylabel("Im L")


def draw_margins(axes: list[plt.Axes], rows: list[dict]) -> None:
    hz = [row["yaw_hz"] for row in rows]
    for i, place in enumerate(PLACES):
        color = f"C{i}"
        axes[0].plot(hz, [margin(r, place, "phase_deg") for r in rows], "o-", color=color)
        axes[0].axhline(WANTED["phase_deg"][place], color=color, lw=0.8, ls=":")
        for name in ("gain_up_dB", "gain_down_dB"):
            axes[1].plot(hz, [margin(r, place, name) for r in rows], "o-", color=color)
        axes[2].plot(hz, [margin(r, place, "delay_ms") for r in rows], "o-", color=color)
    axes[1].axhline(WANTED["gain_dB"], color="0.4", lw=0.8, ls=":")
    axes[2].axhline(WANTED["delay_ms"], color="0.4", lw=0.8, ls=":")
    labels = ("phase margin, degrees", "gain margins, dB", "delay margin, ms")
    for panel, label, top in zip(axes, labels, (90, 25, 40), strict=True):
        panel.set_ylim(0, top)
        panel.set_ylabel(label)
        panel.set_xlabel("yaw rate, Hz")


def draw(design: dict) -> plt.Figure:
    figure, axes = plt.subplots(2, 3, figsize=(12, 7), layout="constrained")
    figure.suptitle(f"{design['robot']}, {design['controller']} on {design['estimator']}")
    draw_bode(axes[0][0], axes[1][0], design["rows"][0])
    draw_nyquist(axes[0][1], design["rows"][0])
    draw_margins([axes[0][2], axes[1][1], axes[1][2]], design["rows"])
    return figure


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(prog="equipoise_tools.design", description=__doc__.splitlines()[0])
    parser.add_argument("file", nargs="?", default="-", help="JSON of equipoise design --bode; - for stdin")
    parser.add_argument("--output", type=Path, required=True, help="picture, .png or .svg")
    options = parser.parse_args(arguments)
    text = sys.stdin.read() if options.file == "-" else Path(options.file).read_text(encoding="utf-8")
    design = json.loads(text)
    if any("loop" not in row for row in design["rows"]):
        print("no frequency responses in the JSON: equipoise design --bode", file=sys.stderr)
        return 2
    draw(design).savefig(options.output, dpi=120)
    return 0


if __name__ == "__main__":
    sys.exit(main())
