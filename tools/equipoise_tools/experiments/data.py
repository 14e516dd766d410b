"""What an experiment measured: a number per run and quantity, and time series for its figures, as Parquet."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ..paths import UserError, commit_and_date

TEXTS = ("case", "filter", "control", "world", "gains", "fitted", "quantity")
TRACE_HZ = 20.0
TRACE_NUMBER = pa.decimal128(18, 5)  # what a figure shows; a third smaller than floating point
STATISTICS = {
    "median": np.median,
    "5 %": lambda values: np.percentile(values, 5),
    "95 %": lambda values: np.percentile(values, 95),
    "smallest": np.min,
    "largest": np.max,
    "share": np.mean,  # of a quantity that is 0 or 1
}


@dataclass(frozen=True)
class Ran:
    """What ran, or what was evaluated. A dash: there is none."""

    filter: str = "-"  # whose numbers these are
    control: str = "-"
    world: str = "-"
    gains: str = "-"
    fitted: str = ""  # what was put in or fitted so that numbers agree; empty: nothing

    def __str__(self) -> str:
        words = [text for text in (self.filter, self.control, self.gains, self.world) if text != "-"]
        return ", ".join(words + [f"fitted: {self.fitted}"] * bool(self.fitted)) or "formula"


@dataclass
class Data:
    """Rows are dictionaries of TEXTS, seed, duration_s and value."""

    rows: list[dict] = field(default_factory=list)
    traces: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)  # (case, series), at TRACE_HZ
    at: str = ""  # commit and date of the measurement; empty: now
    _values: dict | None = None

    def add(
        self, case: str, quantity: str, value: float, ran: Ran = Ran(), seed: int = 0, duration_s: float = 0.0
    ) -> None:
        names = {"filter": ran.filter, "control": ran.control, "world": ran.world, "gains": ran.gains}
        row = {"case": case, **names, "fitted": ran.fitted, "seed": seed, "duration_s": duration_s}
        self.rows.append({**row, "quantity": quantity, "value": float(value)})
        self._values = None

    def _index(self) -> dict:
        if self._values is None:
            self._values = defaultdict(list)
            for row in self.rows:
                self._values[row["case"], row["filter"], row["quantity"]].append(row)
        return self._values

    def _find(self, case: str, quantity: str, filter_name: str | None) -> list[dict]:
        index = self._index()
        if filter_name is not None:
            found = index.get((case, filter_name, quantity), [])
        else:
            keys = [key for key in index if key[0] == case and key[2] == quantity]
            if len(keys) > 1:
                raise KeyError(f"{case}, {quantity}: of {', '.join(key[1] for key in keys)}?")
            found = index[keys[0]] if keys else []
        if not found:
            raise KeyError(f"no {quantity} of {filter_name or 'any filter'} in case {case}")
        return found

    def values(self, case: str, quantity: str, filter_name: str | None = None) -> np.ndarray:
        """By seed; without runs that have no such number (fallen too early to count)."""
        rows = sorted(self._find(case, quantity, filter_name), key=lambda row: row["seed"])
        values = np.array([row["value"] for row in rows])
        return values[np.isfinite(values)]

    def ran(self, case: str, quantity: str, filter_name: str | None = None) -> Ran:
        row = self._find(case, quantity, filter_name)[0]
        return Ran(row["filter"], row["control"], row["world"], row["gains"], row["fitted"])

    def statistic(
        self, case: str, quantity: str, filter_name: str | None = None, statistic: str = "median"
    ) -> float:
        """NaN when no run has the number."""
        values = self.values(case, quantity, filter_name)
        return float(STATISTICS[statistic](values)) if values.size else float("nan")

    def trace(self, case: str, series: str) -> np.ndarray:
        return self.traces[case, series]

    def trace_s(self, case: str, series: str) -> np.ndarray:
        return np.arange(self.traces[case, series].size) / TRACE_HZ


def files(name: str, out_dir: Path) -> tuple[Path, Path]:
    return out_dir / "data" / f"{name}.parquet", out_dir / "data" / f"{name}_traces.parquet"


def write(name: str, data: Data, out_dir: Path) -> None:
    numbers, traces = files(name, out_dir)
    numbers.parent.mkdir(parents=True, exist_ok=True)
    rows = sorted(data.rows, key=lambda r: (r["case"], r["filter"], r["quantity"], r["seed"]))
    columns = {text: pa.array([row[text] for row in rows]).dictionary_encode() for text in TEXTS}
    columns["seed"] = pa.array([row["seed"] for row in rows], pa.int32())
    columns["duration_s"] = pa.array([row["duration_s"] for row in rows], pa.float32())
    columns["value"] = pa.array([row["value"] for row in rows], pa.float64())
    options = {"compression": "zstd", "compression_level": 19}
    named = [*TEXTS, "seed", "duration_s"]
    at = {"at": data.at or ", ".join(commit_and_date())}
    table = pa.table(columns).replace_schema_metadata(at)
    pq.write_table(table, numbers, use_byte_stream_split=["value"], use_dictionary=named, **options)
    traces.unlink(missing_ok=True)
    if data.traces:
        keys = sorted(data.traces)
        values = pa.array(
            [data.traces[key] for key in keys], pa.list_(pa.float64()), from_pandas=True  # NaN: null
        )
        rounded = pc.round(values.values, TRACE_NUMBER.scale).cast(TRACE_NUMBER, safe=False)
        table = pa.table(
            {
                "case": pa.array([case for case, _ in keys]),
                "series": pa.array([series for _, series in keys]),
                "values": pa.ListArray.from_arrays(values.offsets, rounded),
            }
        )
        split = ["values.list.element"]
        options |= {"use_dictionary": False, "store_decimal_as_integer": True}
        pq.write_table(table, traces, use_byte_stream_split=split, **options)


def read(name: str, out_dir: Path) -> Data:
    numbers, traces = files(name, out_dir)
    if not numbers.exists():
        raise UserError(f"{numbers}: no such data; run without --from-data")
    table = pq.read_table(numbers)
    data = Data(rows=table.to_pylist(), at=(table.schema.metadata or {}).get(b"at", b"").decode())
    if traces.exists():
        for row in pq.read_table(traces).to_pylist():
            data.traces[row["case"], row["series"]] = np.array(row["values"], dtype=float)
    return data


def thinned(t_s: np.ndarray, values: np.ndarray, until_s: float, from_s: float = 0.0) -> np.ndarray:
    """At TRACE_HZ, rounded to what a figure shows."""
    at = np.arange(from_s, min(until_s, float(t_s[-1])), 1 / TRACE_HZ)
    return np.round(np.interp(at, t_s, values), 4)
