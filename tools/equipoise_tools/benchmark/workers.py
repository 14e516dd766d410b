"""Processes that run trials; a module of its own, for they import it by name."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator

from . import runs
from .peers import Factors


def work(job: tuple[runs.Trial, str, Factors]) -> dict:
    return runs.run(*job)


class Workers:
    """Processes that Ctrl-C leaves to us."""

    def __init__(self, count: int) -> None:
        context = multiprocessing.get_context("spawn")
        self.pool = context.Pool(count, signal.signal, (signal.SIGINT, signal.SIG_IGN))

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self.pool.terminate()
        self.pool.join()

    def rows(self, jobs: list[tuple[runs.Trial, str, Factors]]) -> Iterator[dict]:
        return self.pool.imap_unordered(work, jobs, chunksize=4)

    def run(self, trials: list[runs.Trial], fidelity: str, factors: Factors) -> list[dict]:
        return list(self.rows([(trial, fidelity, factors) for trial in trials]))
