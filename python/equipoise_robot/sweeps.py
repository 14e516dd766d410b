"""Many runs on all cores."""

from __future__ import annotations

import itertools
import multiprocessing
import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm  # type: ignore[import-untyped]

from ._data import need
from .errors import UserError
from .simulation import run

if TYPE_CHECKING:
    import pandas  # type: ignore[import-untyped]


def grid(over: Mapping[str, Iterable[Any]]) -> list[dict[str, Any]]:
    """Every combination; the last name varies fastest."""
    values = [list(choices) for choices in over.values()]
    return [dict(zip(over, row, strict=True)) for row in itertools.product(*values)]


def _row(robot: str | Path, asked: dict[str, Any]) -> dict[str, Any]:
    result = run(robot, **asked).to_dict()
    result.pop("estimators")
    # What was asked for stays as asked: the run itself may be shorter.
    named = {key: value for key, value in asked.items() if isinstance(value, str | int | float)}
    named["ran_s"] = result.pop("duration_s")
    return result | named


def sweep(
    robot: str | Path = "mbbr",
    over: Mapping[str, Iterable[Any]] | Sequence[Mapping[str, Any]] = (),
    *,
    jobs: int | None = None,
    progress: bool = True,
    **fixed: Any,
) -> pandas.DataFrame:
    """Runs in a process pool -> a DataFrame, a row per run in the order asked for, figures under run()'s
    names.

    over: {"yaw_hz": [0, 1, 2], "seed": range(20)} for every combination, or a list of dictionaries; `fixed`
    goes to every run. The numbers do not depend on `jobs` (default: one per core). Own estimators and
    controllers must be importable, as for any process pool. ran_s: how long the robot really ran.
    """
    pandas = need("pandas", "pandas")
    rows = grid(over) if isinstance(over, Mapping) else [dict(row) for row in over]
    if not over or not rows:
        raise UserError("sweep: nothing to vary; over={'seed': range(10)}, for example")
    asked = [{**fixed, **row} for row in rows]
    workers = min(jobs or os.cpu_count() or 1, len(asked))
    results: list[dict[str, Any]] = [{} for _ in asked]
    with tqdm(total=len(asked), unit="run", disable=None if progress else True) as bar:
        if workers == 1:
            for i, row in enumerate(asked):
                results[i] = _row(robot, row)
                bar.update()
        else:
            context = multiprocessing.get_context("forkserver")
            with ProcessPoolExecutor(workers, mp_context=context) as pool:
                waiting = {pool.submit(_row, robot, row): i for i, row in enumerate(asked)}
                try:
                    for done in as_completed(waiting):
                        results[waiting[done]] = done.result()
                        bar.update()
                except BaseException:
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
    return pandas.DataFrame(results)
