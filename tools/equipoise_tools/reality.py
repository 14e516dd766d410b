"""What the firmware would have done beside real robots: docs/reports/reality.md; tools/reality."""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from .entry import leave
from .noise_comparison import MOTIONS, real_motions, shape
from .paths import binary, commit_and_date, repository_root
from .table import matlab

MAPS = Path("config/real/maps")
PAGE, DATA = Path("docs/reports/reality.md"), Path("docs/reports/reality.json")
HEAD = """# Real robots: tables
Written by `tools/reality FOLDER --write` at {version}, {date}. What the columns mean and why the numbers are
what they are: [reality.md](../reality.md).

## Shadow
"""


def vibration_rows(found: dict[str, Any]) -> list[str]:
    rows = ["| log | gyro x y z, rad/s | accelerometer x y z, m/s2 | lag-1 | excess kurtosis |"]
    rows += ["|---|---|---|---|---|"]
    for log, motions_of in found.items():
        for motion, s in motions_of.items():
            sigma, (lag, tails) = s["sigma"], (s["lag_1"], s["excess_kurtosis"])
            cells = [" ".join(f"{v:.3f}" for v in sigma[:3]), " ".join(f"{v:.2f}" for v in sigma[3:])]
            cells += [f"{min(lag):.2f} to {max(lag):.2f}", f"{min(tails):.1f} to {max(tails):.1f}"]
            rows.append(f"| {log}, {motion} | {' | '.join(cells)} |")
    return rows


def maps_of(root: Path) -> dict[str, dict[str, Any]]:
    return {file.stem: tomllib.loads(file.read_text()) for file in sorted((root / MAPS).glob("*.toml"))}


def found(folder: Path, source: dict[str, str]) -> Path | None:
    """The log a map is for, if it is there and the same."""
    owner, name = source["repository"].split("/")
    for repository in (f"{owner}+{name}", f"{owner}/{name}", name):
        path = folder / repository / source["path"]
        if path.is_file():
            if hashlib.sha256(path.read_bytes()).hexdigest() == source["sha256"]:
                return path
            print(f"{path}: is another version than commit {source['commit']} has", file=sys.stderr)
    return None


def measured(root: Path, table: Path, map_file: Path) -> dict[str, Any]:
    def run(*arguments: str | Path) -> dict[str, Any]:
        command = [str(root / "build/host/equipoise"), *map(str, arguments), "--json", "-"]
        done = subprocess.run(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True, cwd=root
        )
        result: dict[str, Any] = json.loads(done.stdout)
        return result

    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.lcm"
        checks = run("import", table, "--map", map_file, "-o", log)
        return {"checks_failed": checks["checks_failed"], **run("replay", log, "--shadow")}


def can_be_identified(content: dict[str, Any]) -> bool:
    """By the robot's own tilt: a fit and a check need some seconds each."""
    stretches = content.get("balancing", [{"from_s": 0.0, "to_s": float("inf")}])
    return "tilt" in content and sum(s["to_s"] - s["from_s"] for s in stretches) > 5.0


def identified(table: Path, map_file: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "equipoise_tools.identify_balancing", str(table), "--map", str(map_file)]
    done = subprocess.run([*command, "--json"], stdout=subprocess.PIPE, check=True)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def motors(root: Path, folder: Path, map_file: Path) -> dict[str, Any] | None:
    """R and k of every motor log there, or why not, beside the published ones."""
    described = tomllib.loads(map_file.read_text())
    owner, name = described["source"]["repository"].split("/")
    files = sorted(
        f
        for r in (f"{owner}+{name}", f"{owner}/{name}", name)
        for f in folder.glob(f"{r}/{described['source']['path']}")
    )
    taken, refused = {}, {}
    for file in files:
        with tempfile.TemporaryDirectory() as temporary:
            table = file
            if file.suffix == ".mat":
                table = Path(temporary) / "table.csv"
                matlab(file).to_csv(table, index=False)
            for motor in ("1", "2"):
                command = [root / "build/host/equipoise", "identify", "motor", table, "--map", map_file]
                command += ["--motor", motor, "--json", "-"]
                done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
                log = f"{file.name}, motor {motor}"
                if done.returncode == 0:
                    taken[log] = json.loads(done.stdout)["estimates"]
                else:
                    refused[log] = done.stderr.strip().split(f"{table}: ")[-1]
    hashes = {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in files}
    published = described["published"]
    return {"published": published, "taken": taken, "refused": refused, "sha256": hashes} if files else None


def motor_rows(found: dict[str, Any]) -> list[str]:
    rows = ["| log | R, ohm | k, N m/A | published |", "|---|---|---|---|"]
    for content in found.values():
        p = content["published"]
        published = f"{p['resistance_ohm']:.3g}, {p['torque_constant_N_m_A']:.4g}"
        for log, e in content["taken"].items():
            cells = (e["resistance_ohm"], e["torque_constant_N_m_A"])
            values = " | ".join(f"{c['value']:.4g} +- {c['half_width_95']:.2g}" for c in cells)
            rows.append(f"| {log} | {values} | {published} |")
        rows += [f"| {log} | refused: {why} | | {published} |" for log, why in content["refused"].items()]
    return rows


def shown(value: float | None, scale: float = 1.0, digits: int = 2) -> str:
    return "-" if value is None else f"{scale * value:.{digits}f}"


def causes(shadow: dict[str, Any]) -> str:
    alarms = shadow["alarms"]
    if not alarms:
        return "0"
    return f"{len(alarms)}: " + ", ".join(f"{a['hypothesis']} at {a['t_s']:.2f} s" for a in alarms[:4])


def nis(shadow: dict[str, Any]) -> str:
    return ", ".join(f"{name} {value:.2f}" for name, value in shadow.get("nis", {}).items()) or "-"


def ahead(shadow: dict[str, Any], what: str) -> str:
    if "ahead" not in shadow or "100ms" not in shadow["ahead"]:
        return "-"
    a = shadow["ahead"]["100ms"]
    return " / ".join(shown(x[what], 1e3, 1) for x in (a, a["persistence"], a["constant_rate"]))


def noise(shadow: dict[str, Any], sensor: str) -> str:
    axes = [v for name, v in shadow.get("noise", {}).items() if name.startswith(sensor)]
    if not axes:
        return "-"
    return (
        " ".join(shown(v["log"], 1, 3) for v in axes)
        + f" (the world's chip: {shown(axes[0]['configured'], 1, 3)})"
    )


def page_of(data: dict[str, Any], maps: dict[str, dict[str, Any]]) -> str:
    rows = [
        "| log | balancing, s | alarms | NIS per row | tilt against smoother, mrad |",
        "|---|---|---|---|---|",
    ]
    ahead_rows = ["| log | tilt | wheels |", "|---|---|---|"]
    noise_rows = ["| log | gyro x y z, rad/s | accelerometer x y z, m/s2 |", "|---|---|---|"]
    origin = ["| log | repository, commit | path | licence | sha256 |", "|---|---|---|---|---|"]
    for name, s in data["now"].items():
        runs = {name: s}
        if earlier := data.get("before", {}).get(name):
            runs[f"{name}, {data['before_version']}"] = earlier
        for run, x in runs.items():
            tilt = shown(x["tilt_std_rad"], 1e3, 1)
            rows.append(f"| {run} | {x['judged_s']:.1f} | {causes(x)} | {nis(x)} | {tilt} |")
            ahead_rows.append(f"| {run} | {ahead(x, 'tilt')} | {ahead(x, 'wheel')} |")
        noise_rows.append(f"| {name} | {noise(s, 'gyro')} | {noise(s, 'accel')} |")
    known_rows = [
        "| log | fitted | configured | rest: configured | identified | persistence | constant rate |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, s in data.get("identified", {}).items():
        fitted = ", ".join(
            f"{n} {round(e['value'], 6):.3g} +- {e['half_width_95']:.2g}" for n, e in s["estimates"].items()
        )
        configured = ", ".join(f"{n} {value:.3g}" for n, value in s["configured"].items() if value)
        identified_ahead = s["ahead_identified"]
        errors = [s["ahead_configured"]["model"], identified_ahead["model"]]
        errors += [identified_ahead["persistence"], identified_ahead["constant_rate"]]
        cells = " | ".join(f"{shown(e['tilt'], 1e3, 1)}, {shown(e['wheel'], 1e3, 1)}" for e in errors)
        known_rows.append(f"| {name} | {fitted} | {configured} | {cells} |")
    for name, content in maps.items():
        source = content["source"]
        origin.append(
            f"| {name} | [{source['repository']}](https://github.com/{source['repository']}) "
            f"{source['commit']} | {source['path']} | {source['licence']} | `{source['sha256'][:16]}` |"
        )
    for name, content in data.get("motors", {}).items():
        source = tomllib.loads((repository_root() / MAPS.parent / f"motors/{name}.toml").read_text())[
            "source"
        ]
        link = f"[{source['repository']}](https://github.com/{source['repository']}) {source['commit']}"
        for file, digest in content["sha256"].items():
            path = Path(source["path"]).parent / file
            origin.append(f"| {name} | {link} | {path} | {source['licence']} | `{digest[:16]}` |")
    return HEAD.format(**data) + "\n".join(
        [
            *rows,
            "\n0.1 s ahead, error (RMS, mrad): model / persistence / constant rate.\n",
            *ahead_rows,
            "\nNoise of the samples while balancing (second differences, as white noise).\n",
            *noise_rows,
            "\n## Vibration\n",
            "Above 20 Hz at 200 Hz, standard deviation; rolling: on casters.\n",
            *vibration_rows(data.get("vibration", {})),
            "\n## Identified\n",
            "`tools/lab identify`, SI, first half fitted; 0.1 s ahead in the rest: tilt, wheels, mrad.\n",
            *known_rows,
            "\n`equipoise identify motor`, 95 % intervals.\n",
            *motor_rows(data.get("motors", {})),
            "\n## Origin\n",
            *origin,
            "",
        ]
    )


def main() -> int:
    parser = argparse.ArgumentParser(prog="tools/reality", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--before", action="store_true")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    root = repository_root()
    data_file = root / DATA
    data = json.loads(data_file.read_text()) if data_file.exists() else {"now": {}}
    maps = maps_of(root)
    done, missing, ran = {}, [], 0
    for file in sorted((root / MAPS).glob("*.toml")):
        table = found(arguments.folder.resolve(), maps[file.stem]["source"])
        if table is None:
            print(f"{file.stem}: not in {arguments.folder}", file=sys.stderr)
            missing.append(file.stem)
            continue
        ran += 1
        print(f"{file.stem} ...", file=sys.stderr)
        if file.stem in MOTIONS:
            _, motions_of = real_motions(binary(), table, file)
            shapes = {motion: shape(samples) for motion, samples in motions_of.items()}
            data.setdefault("vibration", {})[file.stem] = shapes
        if "gyro" in maps[file.stem]:
            done[file.stem] = measured(root, table, file)
        if can_be_identified(maps[file.stem]):
            known = identified(table, file)
            data.setdefault("identified", {})[file.stem] = known | {"log": table.name}
    for file in sorted((root / MAPS).parent.glob("motors/*.toml")):
        found_motors = motors(root, arguments.folder.resolve(), file)
        if found_motors is None:
            missing.append(file.stem)
        else:
            ran += 1
            data.setdefault("motors", {})[file.stem] = found_motors
    if ran == 0:
        print(f"{arguments.folder}: holds none of the logs of docs/reports/reality.md", file=sys.stderr)
        return 1
    commit, today = commit_and_date()
    if missing:  # their numbers are from before
        data["date"] += f"; at {commit}, {today} all but {', '.join(missing)}"
    else:
        data["version"], data["date"] = commit, today
    data["now"] |= done
    if arguments.before:
        data["before"], data["before_version"] = dict(data["now"]), data["version"]
    for shadow in done.values():
        for key in ("log", "config", "version"):
            shadow.pop(key, None)
    exact = json.dumps(data, sort_keys=True)
    kept = json.loads(exact, parse_float=lambda number: float(f"{float(number):.6g}"))
    page = page_of(kept, maps)
    if not arguments.write:
        print(page)
        return 0
    data_file.write_text(json.dumps(kept, separators=(",", ":")) + "\n")
    (root / PAGE).write_text(page)
    return 0


if __name__ == "__main__":
    leave(main)
