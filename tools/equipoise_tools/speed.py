"""How fast the simulated loop and its plant run, beside MuJoCo in the same minutes; tools/speed.

CPU time of one core but where said, and the difference of a long and a short run, so that the start is left
out. Rounds are interleaved; a median stands with its range.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .count_page import ROBOTS
from .entry import leave
from .paths import UserError, commit_and_date, repository_root

PAGE = Path("docs/reports/speed.md")
SHORTEST_S, SHORT_S, LONG_S = 0.1, 20, 220
ENDLESS_S, WARM_S = 36000, 1.0  # of simulation; of running
TICKS = (2000, 22000)
TICK_S = 0.005
STEPS_PER_TICK = 5  # world.step_s: 1 ms
MUJOCO_STEPS, MUJOCO_EPISODE = 20000, 400  # a robot that is left alone falls; at 0.4 s it starts again
BATCH, BATCH_TICKS = 64, 1500
CAMPAIGN = ["--robots", "40", "--fault", "imu_gap_100ms", "encoder_dead", "--phase", "balancing", "driving"]


def child(command: list[str], root: Path) -> tuple[float, float]:
    """CPU seconds, wall seconds."""
    began = time.monotonic()
    with subprocess.Popen(command, cwd=root, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            said = process.stderr.read().decode(errors="replace") if process.stderr else ""
            raise UserError(f"{' '.join(command)} failed:\n{said[-2000:]}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - began


def simulated(root: Path, robot: str, fidelity: str, duration_s: float, drives: bool = True) -> list[str]:
    yaw_hz, drive_mps = ("1" if robot == "mbbr" else "0", "0.2") if drives else ("0", "0")
    return [
        str(root / "build/host/equipoise"),
        *("sim", "--config", ROBOTS[robot], "--fidelity", fidelity, "--log", "off", "--telemetry", "off"),
        *("--duration-s", str(duration_s), "--yaw-hz", yaw_hz, "--drive-mps", drive_mps),
    ]


def closed_loop(root: Path, robot: str, fidelity: str, drives: bool = True) -> float:
    """Simulated seconds per CPU second: plant at 1 kHz, sensors, the whole firmware at 200 Hz."""
    long, short = (child(simulated(root, robot, fidelity, t, drives), root)[0] for t in (LONG_S, SHORT_S))
    return (LONG_S - SHORT_S) / (long - short)


def plant(root: Path, fidelity: str) -> float:
    """Steps of the MBBR's plant per CPU second."""
    program = str(root / "build/host/tests/bench/instruction_count")
    command = [program, "mbbr", ROBOTS["mbbr"], f"plant-{fidelity}"]
    few, many = (child([*command, str(n)], root)[0] for n in TICKS)
    return STEPS_PER_TICK * (TICKS[1] - TICKS[0]) / (many - few)


def mujoco() -> float:
    """Its steps per CPU second: body and ball with a contact, without motors, bridges and gears."""
    from .mujoco_client import Robot

    robot = Robot()
    robot.model.opt.timestep = 0.001
    began = time.thread_time()
    for _ in range(MUJOCO_STEPS // MUJOCO_EPISODE):
        robot.mujoco.mj_resetData(robot.model, robot.data)
        robot.mujoco.mj_step(robot.model, robot.data, nstep=MUJOCO_EPISODE)
    return MUJOCO_STEPS / (time.thread_time() - began)


def wheels_from_axes(root: Path) -> NDArray[np.float64]:
    """Of the MBBR, as src/robots/mbbr/omniwheels.hpp: the transpose of its wheels' axes over r / r_w."""
    robot = tomllib.loads((root / ROBOTS["mbbr"]).read_text(encoding="utf-8"))["robot"]
    alpha, azimuth = np.radians((robot["wheel_latitude_deg"], robot["wheel_azimuth_deg"]))
    beta = np.arccos(1.0 / (np.sqrt(3.0) * np.sin(alpha)))
    along = [np.cos(beta) * np.cos(alpha), -np.sin(beta), np.cos(beta) * np.sin(alpha)]
    turns = azimuth + 2.0 * np.pi / 3.0 * np.arange(3)
    c, s = np.cos(turns), np.sin(turns)
    axes = [c * along[0] - s * along[1], s * along[0] + c * along[1], np.full(3, along[2])]
    return np.transpose(axes) * robot["wheel_radius_m"] / robot["ball_radius_m"]


def standing_policy(root: Path, robot: str, names: list[str]) -> NDArray[np.float64]:
    """The design's gains as one matrix, observation to wheels: the robot stays where it stood up."""
    import equipoise_robot as eq

    K = np.zeros((3 if robot == "mbbr" else 2, len(names)))
    if robot == "mbbr":
        design = eq.design("mbbr", last_hz=0.0)
        gains = [float(g[0]) for g in design.rows[0]["lqr"]["K"]]
        for i, axis in enumerate("xy"):
            for name, gain in zip(("theta", "phi", "theta_dot", "phi_dot"), gains, strict=False):
                K[i, names.index(f"{name}_{axis}")] = gain
        K[2, names.index("theta_z")] = -design.gains["yaw_angle"]
        K[2, names.index("yaw_rate")] = -design.gains["yaw_rate"]
        return wheels_from_axes(root) @ K
    gains = eq.design("mip", controller="lqr", last_hz=0.0).gains
    for name, gain in zip(("theta", "phi", "theta_dot", "phi_dot"), gains["lqr"], strict=False):
        K[:, names.index(name)] = gain
    K[:, names.index("psi")] = gains["yaw_angle"], -gains["yaw_angle"]
    K[:, names.index("psi_dot")] = gains["yaw_rate"], -gains["yaw_rate"]
    return K


def batch(root: Path, robot: str) -> float:
    """Simulated seconds of all robots per second of the wall's clock, on all cores, balanced by a policy."""
    from equipoise_robot.envs import BalanceVectorEnv

    env = BalanceVectorEnv(str(root / ROBOTS[robot]), num_envs=BATCH)
    K = standing_policy(root, robot, env.observation_names)
    observation, _ = env.reset(seed=1)
    began = time.monotonic()
    for _ in range(BATCH_TICKS):
        observation, _, lost, _, _ = env.step(observation @ K.T)
        if lost.any():
            raise UserError(f"batch: the policy lets the {robot} fall")
    spent = time.monotonic() - began
    env.close()
    return BATCH * BATCH_TICKS * TICK_S / spent


def cores(root: Path) -> dict[str, float]:
    """Wall time of a campaign on one core over that on two; what the machine itself gives, by campaigns on
    one core that know nothing of each other, two at a time; the first over the second: ours alone."""
    command = [
        str(root / "build/host/equipoise"),
        "campaign",
        "--config",
        ROBOTS["mbbr"],
        *CAMPAIGN,
        "--jobs",
    ]
    one, two = (child([*command, n], root)[1] for n in ("1", "2"))
    began = time.monotonic()
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda n: child([*command, n], root), ("1", "1")))
    ours, machine = one / two, 2.0 * one / (time.monotonic() - began)
    return {"cores": ours, "cores of the machine": machine, "cores over the machine's": ours / machine}


def start_ms(root: Path) -> float:
    """Wall time of a run of a tenth of a second, start and end included."""
    return 1e3 * child(simulated(root, "mbbr", "full", SHORTEST_S), root)[1]


def memory_MB(root: Path) -> float:
    """The most that was resident, of the process alone: wait4() counts its parent before exec, too."""
    command = simulated(root, "mbbr", "full", ENDLESS_S)
    with subprocess.Popen(command, cwd=root, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            time.sleep(WARM_S)
            status = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
        finally:
            process.kill()
    found = re.search(r"^VmHWM:\s+(\d+) kB$", status, re.M)
    if found is None:
        raise UserError("the simulation ended before its memory was read")
    return int(found[1]) / 1024.0


def filter_code(root: Path, build: str, nm: str) -> dict[str, int] | None:
    """Bytes of code that a step of the default filter runs through, by robot."""
    archive = root / build / "libequipoise_core.a"
    if not archive.is_file():
        return None
    said = subprocess.run([nm, "-S", "-C", str(archive)], capture_output=True, text=True, check=True).stdout
    sizes = {"mbbr": 0, "mip": 0}
    seen = set()
    for line in said.splitlines():
        words = line.split(None, 3)
        if len(words) < 4 or words[2].upper() not in ("T", "W") or words[3] in seen:
            continue
        if "[clone ." in words[3] and not words[3].endswith("[clone .default]"):  # for some processors alone
            continue
        seen.add(words[3])
        for robot, states in (("mbbr", 18), ("mip", 14)):
            steps = tuple(f"{robot.capitalize()}Filter::{f}(" for f in ("predict", "correct", "ahead"))
            if any(s in words[3] for s in steps) or f"downdate<{states}," in words[3]:
                sizes[robot] += int(words[1], 16)
    return sizes


def measure(root: Path, rounds: int, say: Callable[[str], None]) -> dict:
    parts: dict[str, Callable[[], float | dict[str, float]]] = {
        f"closed_loop {robot} {fidelity}": lambda r=robot, f=fidelity: closed_loop(root, r, f)
        for robot in ROBOTS
        for fidelity in ("nominal", "full")
    }
    for robot in ROBOTS:
        parts[f"standing {robot}"] = lambda r=robot: closed_loop(root, r, "nominal", drives=False)
        parts[f"batch {robot}"] = lambda r=robot: batch(root, r)
    parts |= {f"plant {f}": lambda f=f: plant(root, f) for f in ("ideal", "full")}
    parts |= {
        "mujoco": mujoco,
        "cores": lambda: cores(root),
        "start_ms": lambda: start_ms(root),
        "memory_MB": lambda: memory_MB(root),
    }
    found: dict[str, list[float]] = {key: [] for key, *_ in ROWS}
    missing: dict[str, str] = {}
    for k in range(rounds):
        for name, part in parts.items():
            if name in missing:
                continue
            try:
                value = part()
                for key, each in (value if isinstance(value, dict) else {name: value}).items():
                    found[key].append(each)
            except (UserError, ImportError) as problem:
                missing[name] = str(problem).splitlines()[-1]
        say(f"round {k + 1} of {rounds}")
    for f in ("ideal", "full"):
        ours, theirs = found[f"plant {f}"], found["mujoco"]
        found[f"plant over mujoco {f}"] = [a / b for a, b in zip(ours, theirs, strict=False)]
    for robot in ROBOTS:
        together, alone = found[f"batch {robot}"], found[f"standing {robot}"]
        found[f"batch over loops {robot}"] = [
            a / (b * (os.cpu_count() or 1)) for a, b in zip(together, alone, strict=False)
        ]
    result: dict = {
        name: {"median": statistics.median(v), "least": min(v), "most": max(v)} if v else None
        for name, v in found.items()
    }
    return result | {
        "missing": missing,
        "rounds": rounds,
        "load": os.getloadavg()[0],
        "cores_of_the_machine": os.cpu_count(),
        "filter_bytes_x86": filter_code(root, "build/host", "nm"),
        "filter_bytes_cortex_a8": filter_code(root, "build/bbb", "arm-linux-gnueabihf-nm"),
    }


ROWS = [
    ("closed_loop mbbr nominal", "closed loop, MBBR, `nominal`", "x real time", 0),
    ("closed_loop mbbr full", "closed loop, MBBR, `full`", "x real time", 0),
    ("closed_loop mip nominal", "closed loop, eduMIP, `nominal`", "x real time", 0),
    ("closed_loop mip full", "closed loop, eduMIP, `full`", "x real time", 0),
    ("standing mbbr", "closed loop, MBBR, `nominal`, standing", "x real time", 0),
    ("standing mip", "closed loop, eduMIP, `nominal`, standing", "x real time", 0),
    ("batch mbbr", f"{BATCH} MBBRs in one Gymnasium call, on all cores, wall time", "x real time", 0),
    ("batch mip", f"{BATCH} eduMIPs in one Gymnasium call, on all cores, wall time", "x real time", 0),
    ("batch over loops mbbr", "the former over as many standing closed loops as cores, MBBR", "x", 2),
    ("batch over loops mip", "the former over as many standing closed loops as cores, eduMIP", "x", 2),
    ("plant ideal", "plant alone, `ideal`", "steps/s", -3),
    ("plant full", "plant alone, `full`", "steps/s", -3),
    ("mujoco", "MuJoCo, body and ball on the floor", "steps/s", -3),
    ("plant over mujoco ideal", "plant, `ideal`, over MuJoCo", "x", 2),
    ("plant over mujoco full", "plant, `full`, over MuJoCo", "x", 2),
    ("cores", "campaign on two cores over one, wall time", "x", 2),
    ("cores of the machine", "two campaigns on a core each, over one: what the machine gives", "x", 2),
    ("cores over the machine's", "the first over the second: what is ours", "x", 2),
    ("start_ms", "start, 0.1 s of simulation, end; wall time", "ms", 0),
    ("memory_MB", "resident memory of a simulation", "MB", 0),
]


def number(value: float, digits: int) -> str:
    rounded = round(value, digits)
    return f"{rounded:,.0f}" if digits <= 0 else f"{rounded:,.{digits}f}"


def page(result: dict) -> str:
    lines = [
        "# Speed of the simulation",
        "Written by `./tools/speed --write` at {}, {}.".format(*commit_and_date()),
        f"CPU time of one core but where said; median of "
        f"{result['rounds']} interleaved rounds, least and most. Load of the machine at the end: "
        f"{result['load']:.1f} on {result['cores_of_the_machine']} cores. Counts that do not depend on it: "
        "[performance.md](../performance.md).",
        "",
        "| | median | least | most | |",
        "|---|---|---|---|---|",
    ]
    for key, label, unit, digits in ROWS:
        values = result[key]
        if values is None:
            reason = result["missing"].get(key, "what it is compared with")
            lines.append(f"| {label} | not measured: {reason} | | | |")
            continue
        cells = " | ".join(number(values[k], digits) for k in ("median", "least", "most"))
        lines.append(f"| {label} | {cells} | {unit} |")
    lines += [
        "",
        "Closed loop: the plant at 1 kHz, sensors, the whole firmware at 200 Hz, log and telemetry off, "
        "driving at 0.2 m/s, the MBBR turning at 1 Hz; standing, as the robots of a batch do, wheels stick "
        "and slide in turn and their friction takes longer to solve. The plant beside MuJoCo, 1 ms a step: "
        "ours rolls without slip and has bridges, motors, gears and friction; MuJoCo's has a body and a ball "
        "with an elliptic contact cone and no drive (tools/equipoise_tools/mujoco_client.py).",
    ]
    for key, name in (("filter_bytes_x86", "x86-64"), ("filter_bytes_cortex_a8", "Cortex-A8")):
        sizes = result[key]
        text = ", ".join(f"{v / 1024:.1f} KB ({r})" for r, v in sizes.items()) if sizes else "not measured"
        lines += ["", f"Code of a step of the default filter, {name}: {text}."]
    lines.append("A Cortex-A8's first-level instruction cache holds 32 KB, its second level 256 KB.")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(prog="tools/speed", description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5, help="interleaved (default 5)")
    parser.add_argument("--json", metavar="FILE", help="as JSON; -: to stdout")
    parser.add_argument("--write", action="store_true", help=str(PAGE))
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error("--rounds: 1 or more")
    root = repository_root()
    try:
        result = measure(root, options.rounds, lambda text: print(text, file=sys.stderr, flush=True))
    except KeyboardInterrupt:
        return 130
    text = page(result)
    if options.write:
        (root / PAGE).write_text(text, encoding="utf-8")
    if options.json == "-":
        print(json.dumps(result))
        return 0
    if options.json:
        Path(options.json).write_text(json.dumps(result) + "\n", encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    leave(main)
