"""[T]'s own filters, controllers and gains as settings of a configuration, from config/published.toml."""

from __future__ import annotations

import tomllib
from functools import cache

from .paths import repository_root

INITIAL_VARIANCE = 1e-4  # [T] prints none


@cache
def table() -> dict[str, dict]:
    """Equation, table or section -> its numbers."""
    return tomllib.loads((repository_root() / "config" / "published.toml").read_text(encoding="utf-8"))


def _filter(name: str, q: list[float], r: list[float]) -> dict[str, str]:
    section = f"estimator.{name}."
    return {
        section + "q": str(q),
        section + "r": str(r),
        section + "input_variance": "[0.0, 0.0, 0.0]",  # its Q is diagonal, (6.2)
        section + "initial_variance": str(INITIAL_VARIANCE),
    }


def ekf(equation: str) -> dict[str, str]:
    """The 13-state EKF with the process noise of `equation`."""
    return _filter("ekf13_published", table()[equation]["q"], table()["(6.23)"]["r"])


def kf() -> dict[str, str]:
    """The linear KF of 6.4.6 in place of ours, (5.27)-(5.29), (6.32)."""
    settings = _filter("kf_attitude", table()["(6.32)"]["q_kf"], table()["(6.23)"]["r_kf"])
    return {**settings, "estimator.kf_attitude.model": '"published"'}


def _rows(columns: dict[str, list[float]]) -> str:
    rows = zip(*columns.values(), strict=True)
    tables = ("{" + ", ".join(f"{k} = {v}" for k, v in zip(columns, row, strict=True)) + "}" for row in rows)
    return "[" + ", ".join(tables) + "]"


def gains(where: str) -> dict[str, str]:
    """Feedback gains, SLC and low-pass filter of Table 6.2 or 6.3, or of (6.22), (6.27), (6.29), which have
    no schedule and no low-pass filter."""
    entry = table()[where]
    scheduled = "yaw_hz" in entry
    columns = {
        key: value if scheduled else [value]
        for key, value in ({"yaw_hz": 0.0} | entry).items()
        if key != "used_in"
    }
    corner = table()["6.2.1"]["low_pass_rad_s"] if scheduled else [1000.0]  # the highest allowed
    feedback = {key: columns[key] for key in ("yaw_hz", "c1", "c2", "c3", "c4", "c5", "c6")}
    slc = {key: columns[key] for key in ("yaw_hz", "slc_gain", "slc_pole")}
    return {
        "controller.thesis.gains": _rows(feedback),
        "reference.schedule": _rows({**slc, "low_pass_rad_s": corner}),
    }


def control() -> dict[str, object]:
    """(6.13)'s sign, Euler-angle rates (6.7), filters in the yaw frame (Fig. 6.2), no feed-forward
    of back-EMF (6.10), commands as they come (6.11), Coulomb friction compensated in full (6.14)."""
    return {
        "reference.slc_unit_rad_per_rad_s": table()["(6.13)"]["slc_unit_rad_per_rad_s"],
        "reference.slc_sign": table()["(6.13)"]["slc_sign"],
        "reference.rate_feedback": '"euler"',
        "reference.filter_frame": '"yaw"',
        "reference.max_acceleration_m_s2": 100.0,  # the highest allowed: a step of 0.2 m/s is 40
        "reference.max_yaw_acceleration_rad_s2": 1000.0,  # the highest allowed
        "controller.thesis.yaw_feedforward_s": 0.0,
        "friction.compensation": table()["6.2.2"]["compensation"],
    }


def used_in(figure: str) -> list[str]:
    """Equations and tables with which [T] made a figure or table."""
    return [where for where, entry in table().items() if figure in entry.get("used_in", ())]
