"""Binary tables as CSV: python -m equipoise_tools.table FILE > TABLE.csv; tools/table."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from .entry import leave
from .paths import UserError


def series(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Every vector of numbers in a value of scipy's, by its way through structures."""
    if hasattr(value, "_fieldnames"):
        for field in value._fieldnames:
            yield from series(f"{name}.{field}", getattr(value, field))
        return
    array = np.asarray(value)
    if array.dtype == object:
        for i, element in enumerate(array.ravel(), 1):
            yield from series(f"{name}_{i}", element)
    elif array.dtype.kind in "fiub" and array.ndim in (1, 2) and array.size > 1:
        columns = array.reshape(len(array), -1)
        if columns.shape[0] < columns.shape[1]:
            columns = columns.T
        for i in range(columns.shape[1]):
            yield f"{name}_{i + 1}" if columns.shape[1] > 1 else name, columns[:, i].astype(float)


def matlab(path: Path) -> pd.DataFrame:
    from scipy.io import loadmat  # type: ignore[import-untyped]

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise UserError(f"{path}: is of MATLAB 7.3 (HDF5); save it with '-v7'") from None
    found = [s for name, value in content.items() if name[:2] != "__" for s in series(name, value)]
    if not found:
        raise UserError(f"{path}: holds no series of numbers")
    rows = Counter(len(values) for _, values in found).most_common(1)[0][0]
    for name, values in found:
        if len(values) != rows:
            print(f"{path}: {name} has {len(values)} values, not {rows}: not written", file=sys.stderr)
    return pd.DataFrame({name: values for name, values in found if len(values) == rows})


READERS = {".mat": matlab, ".parquet": pd.read_parquet, ".feather": pd.read_feather}


def main() -> int:
    parser = argparse.ArgumentParser(prog="tools/table", description=__doc__)
    parser.add_argument("file", type=Path)
    path = parser.parse_args().file
    if not path.is_file():
        print(f"{path}: there is no such file", file=sys.stderr)
        return 2
    if path.suffix not in READERS:
        print(f"{path}: {path.suffix or 'no suffix'} is none of {', '.join(READERS)}", file=sys.stderr)
        return 2
    try:
        READERS[path.suffix](path).to_csv(sys.stdout, index=False)
    except BrokenPipeError:
        raise
    except (UserError, OSError, ValueError) as error:
        print(error if isinstance(error, UserError) else f"{path}: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    leave(main)
