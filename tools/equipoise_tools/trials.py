"""Runs of `equipoise trials` for tools that compare them."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

from .paths import UserError, binary, repository_root


def run_trials(
    config: Path | str,
    asked: list[dict],
    settings: Mapping[str, object] | None = None,
    jobs: int | None = None,
) -> list[dict]:
    """The result of each trial that is asked for, in that order. `config`: within the repository."""
    with tempfile.TemporaryDirectory(prefix="equipoise-") as folder:
        request = Path(folder) / "trials.json"
        request.write_text(json.dumps({"trials": asked}), encoding="utf-8")
        command = [binary(), "trials", "--config", config, "--in", request, "--json", "-"]
        command += ["--jobs", jobs or os.cpu_count() or 1]
        for key, value in (settings or {}).items():
            command += ["--set", f"{key}={value}"]
        done = subprocess.run(
            [str(word) for word in command],
            capture_output=True,
            text=True,
            cwd=repository_root(),
            check=False,
        )
    if done.returncode != 0:
        raise UserError(f"{config}, {len(asked)} trials: {done.stderr.strip()}")
    results: list[dict] = json.loads(done.stdout)["trials"]
    return results
