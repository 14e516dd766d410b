"""A recorded run filtered again with another tuning by `equipoise replay --set`: report and cockpit."""

from __future__ import annotations

import subprocess
from pathlib import Path

from .paths import UserError, binary

NOTE = (
    "The second column is no run: another tuning got the samples and commands of the first, and its filter "
    "what that run did to the motors. Its duty is what it would have asked for in the states of the first."
)


def what_if(log: Path, changes: list[str], out: Path) -> tuple[Path, str]:
    """The log of `equipoise replay --set`, in the folder; and a note, if the replay says one."""
    changed = out / "what-if.lcm"
    out.mkdir(parents=True, exist_ok=True)
    command = [binary(), "replay", log, "--log", changed, "--json", "/dev/null"]
    for change in changes:
        command += ["--set", change]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode > 1:
        raise UserError(ran.stderr.strip().removeprefix("equipoise: "))
    differs = "this version's pipeline differs from the recorded one's; equipoise replay says where"
    return changed, differs if ran.returncode == 1 else ""
