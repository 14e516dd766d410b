"""Who stays upright where: the scores with their intervals, drawn."""

from __future__ import annotations

from pathlib import Path

from .. import style
from ..style import plt
from .peers import PEERS
from .runs import ENGINES, POINTS

MARKS = "o^sDvP*X<>"


def draw(scores: list[dict], path: Path) -> None:
    """PATH.png: a panel for each robot type and engine; peers side by side at each point."""
    kinds = list(dict.fromkeys(score["kind"] for score in scores))
    peers = [name for name in PEERS if any(score["peer"] == name for score in scores)]
    points = list(POINTS)
    with style.styled():
        figure, panels = plt.subplots(
            len(kinds),
            len(ENGINES),
            figsize=(11, 3.2 * len(kinds)),
            layout="constrained",
            sharey=True,
            squeeze=False,
        )
        for row, kind in zip(panels, kinds, strict=True):
            for axes, engine in zip(row, ENGINES, strict=True):
                for i, peer in enumerate(peers):
                    there = [
                        score
                        for score in scores
                        if (score["kind"], score["engine"], score["peer"]) == (kind, engine, peer)
                        and score["point"] in points
                    ]
                    share = [100 * score["upright"] / score["runs"] for score in there]
                    ends = zip(share, (score["interval"] for score in there), strict=True)
                    bars = [(max(s - 100 * low, 0.0), max(100 * high - s, 0.0)) for s, (low, high) in ends]
                    at = [
                        points.index(score["point"]) + 0.8 * ((i + 0.5) / len(peers) - 0.5) for score in there
                    ]
                    colour = ([style.ESTIMATE, style.REFERENCE, style.TRUTH, *style.OTHERS] * 2)[i]
                    mark = {"marker": MARKS[i], "markersize": 4, "linestyle": "", "elinewidth": 0.8}
                    axes.errorbar(
                        at, share, list(zip(*bars, strict=True)) or None, label=peer, color=colour, **mark
                    )
                axes.set_xticks(range(len(points)), points)
                axes.set(ylim=(-3, 103), title=f"{kind}, {engine}")
                axes.grid(False, axis="x")
            row[0].set_ylabel("upright, %")
        style.legend_above(figure, panels[0][0], columns=len(peers))
        style.save(figure, path)
