"""One look for every picture: colours that colour-blind readers tell apart (Okabe and Ito), thin axes."""

from __future__ import annotations

import io
import os
from pathlib import Path

import matplotlib
from PIL import Image

matplotlib.use("Agg")
import matplotlib.pyplot as plt

TRUTH = "#000000"
REFERENCE = "#D55E00"
ESTIMATE = "#0072B2"
OTHERS = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F", "#8B6B3E")
DASHES = ("-", (0, (5, 1.5)), (0, (3, 1, 1, 1)), (0, (1, 1)), (0, (6, 2, 1, 2, 1, 2)), (0, (8, 2)))
DRIVE_PHASE = "#0072B2"
SVG_TOO = "EQUIPOISE_SVG"  # in the environment
COLOURS, DPI = 32, 80  # of a tracked picture: the width of a page

RC = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.grid": True,
    "grid.color": "#D8D8D8",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "figure.facecolor": "white",
    "savefig.dpi": 130,
}


def colour(index: int) -> str:
    """Of the index-th estimator; the controlling one is the first."""
    return ESTIMATE if index == 0 else OTHERS[(index - 1) % len(OTHERS)]


def dash(index: int):
    return DASHES[index % len(DASHES)]


def styled():
    return plt.rc_context(RC)


def save(figure: plt.Figure, path: Path) -> None:
    """PATH.png, a quarter of its size by a palette, and PATH.svg if asked for; closes the figure.

    The same bytes every time.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI)
    if os.environ.get(SVG_TOO):  # after the PNG, whose layout it would move
        with plt.rc_context({"svg.hashsalt": path.name}):
            figure.savefig(path.with_suffix(".svg"), metadata={"Date": None})
    plt.close(figure)
    flat = (
        Image.open(drawn)
        .convert("RGB")
        .quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    )
    palette = flat.getpalette() or []
    background = 3 * flat.tobytes()[0]
    palette[background : background + 3] = (255, 255, 255)  # the octree's is a shade darker
    flat.putpalette(palette)
    flat.save(path.with_suffix(".png"), optimize=True)


def legend_above(figure: plt.Figure, axes: plt.Axes, columns: int = 5) -> None:
    """Of one panel for all, where no data is under it."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)
