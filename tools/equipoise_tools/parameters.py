"""python -m equipoise_tools.parameters [--out FILE]

Writes docs/parameters.md: every key of the configurations with unit, range and default from the firmware
(`equipoise config explain`), meaning and source from config/keys.toml.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tomllib
from pathlib import Path

from .entry import leave
from .experiments.runs import equipoise
from .paths import repository_root

ROBOTS = {"mbbr": "MBBR", "edumip": "eduMIP"}
CONFIGURATIONS = ("mbbr", "edumip", "kugle")
WORLD = "full"  # whose values stand for the worlds
HEAD = """# Parameters
Written by `python -m equipoise_tools.parameters` from the firmware and [keys.toml](../config/keys.toml).
Values are those of [config/mbbr.toml](../config/mbbr.toml) and [config/edumip.toml](../config/edumip.toml);
`equipoise config explain KEY --config FILE` shows the same for any configuration. A key with `*` exists in
each simulated world; its value is that of `full`. A row of a table has `[]`; its value is that of the
first row.
"""


def name_of(key: str) -> str:
    """world.full.step_s -> world.*.step_s, gains[2].c1 -> gains[].c1."""
    return re.sub(r"\[\d+\]", "[]", re.sub(r"^world\.\w+\.", "world.*.", key))


def known(table: dict, prefix: str = "") -> dict[str, tuple[str, str]]:
    """Key -> (meaning, source)."""
    found: dict[str, tuple[str, str]] = {}
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            found |= known(value, name + ".")
        else:
            meaning, source = value
            found[name] = (meaning, source)
    return found


def meanings() -> dict[str, tuple[str, str]]:
    return known(tomllib.loads((repository_root() / "config" / "keys.toml").read_text(encoding="utf-8")))


def keys_of(robot: str) -> dict[str, dict]:
    """Key without its world or row -> what the firmware says of it."""
    config = f"config/{robot}.toml"
    tables = {
        key.split(".")[0]
        for key in json.loads(equipoise("config", "show", "--config", config, "--json", "-"))
    }
    found: dict[str, dict] = {}
    for table in sorted(tables):
        said = json.loads(equipoise("config", "explain", table, "--config", config, "--json", "-"))["keys"]
        for fact in said:
            name = name_of(fact["key"])
            if name not in found or fact["key"].startswith(f"world.{WORLD}."):
                found[name] = fact
    return found


def missing(found: dict[str, dict], told: dict[str, tuple[str, str]]) -> list[str]:
    """Keys without a meaning or source."""
    return sorted(name for name in found if not all(told.get(name, ("", ""))))


def shown(value: object) -> str:
    text = json.dumps(value) if not isinstance(value, str) else value
    return text if len(text) <= 60 else text[:57] + "..."


def page(facts: dict[str, dict[str, dict]], told: dict[str, tuple[str, str]]) -> str:
    lines = [HEAD]
    names = sorted(set().union(*(facts[robot] for robot in ROBOTS)))
    table = ""
    for name in names:
        if name.rpartition(".")[0] != table:
            table = name.rpartition(".")[0]
            lines += [
                f"## {table}",
                "",
                f"| key | meaning | unit | range | {' | '.join(ROBOTS.values())} | source |",
            ]
            lines += ["|---|---|---|---|" + "---|" * len(ROBOTS) + "---|"]
        any_fact = next(facts[robot][name] for robot in ROBOTS if name in facts[robot])
        values = [shown(facts[robot][name]["value"]) if name in facts[robot] else "-" for robot in ROBOTS]
        meaning, source = told[name]
        cells = [
            f"`{name.rpartition('.')[2]}`",
            meaning,
            any_fact["unit"] or "",
            any_fact["allowed"] or "",
            *values,
            source,
        ]
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        if name == [n for n in names if n.rpartition(".")[0] == table][-1]:
            lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m equipoise_tools.parameters", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--out", type=Path, default=repository_root() / "docs" / "parameters.md")
    given = parser.parse_args(arguments)
    facts, told = {robot: keys_of(robot) for robot in ROBOTS}, meanings()
    without = sorted({name for found in facts.values() for name in missing(found, told)})
    if without:
        print(f"error: config/keys.toml has no meaning and source of {', '.join(without)}", file=sys.stderr)
        return 1
    given.out.write_text(page(facts, told), encoding="utf-8")
    print(f"{given.out}: {len(set().union(*facts.values()))} keys")
    return 0


if __name__ == "__main__":
    leave(main)
