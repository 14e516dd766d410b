"""Motion capture in C3D: marker positions of one rigid body -> attitude and centroid over time.

Source: the C3D format's user guide. Intel byte order, integer or floating-point points; analogue channels are
skipped. The body's axes are the room's in the first frame in which every marker is seen.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from .mocap import Mocap
from .paths import UserError

_BLOCK = 512
_INTEL = 84
_METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}


@dataclass
class Points:
    rate_hz: float
    position_m: np.ndarray  # frames x markers x 3; NaN where a marker is hidden


def _text_parameter(data: bytes, start: int, group: str, name: str) -> str | None:
    """A parameter of characters, e.g. POINT:UNITS."""
    groups, found = {}, None
    at = start + 4
    while at + 4 <= len(data):
        length, number = struct.unpack_from("bb", data, at)
        if length == 0:
            break
        word = data[at + 2 : at + 2 + abs(length)].decode("latin-1").upper()
        following = at + 2 + abs(length)
        (offset,) = struct.unpack_from("<h", data, following)
        if number < 0:
            groups[-number] = word
        elif word == name:
            kind, dimensions = struct.unpack_from("bB", data, following + 2)
            size = int(np.prod(list(data[following + 4 : following + 4 + dimensions]), initial=1))
            first = following + 4 + dimensions
            if kind == -1:
                found = (number, data[first : first + size].decode("latin-1").strip())
        if offset <= 0:
            break
        at = following + offset
    return found[1] if found and groups.get(found[0]) == group else None


def read_points(path: str | Path) -> Points:
    """Raises UserError naming the file and what is wrong with it."""
    if Path(path).exists() and not Path(path).is_file():
        raise UserError(f"{path}: is no file")  # a pipe or a device might never end
    try:
        return _points(path, Path(path).read_bytes())
    except OSError as error:
        raise UserError(f"{path}: {error.strerror or error}") from None
    except UserError:
        raise
    except (struct.error, LookupError, ValueError) as error:
        raise UserError(f"{path}: no C3D file as the format says ({error})") from None


def _points(path: str | Path, data: bytes) -> Points:
    if len(data) < 2 * _BLOCK or data[1] != 0x50:
        raise UserError(f"{path}: not a C3D file")
    parameters = (data[0] - 1) * _BLOCK
    if parameters + 4 > len(data) or data[parameters + 3] != _INTEL:
        raise UserError(f"{path}: only C3D in Intel byte order can be read; export it again")
    markers, analogue, first, last = struct.unpack_from("<HHHH", data, 2)
    (scale,) = struct.unpack_from("<f", data, 12)
    (block,) = struct.unpack_from("<H", data, 16)
    (rate_hz,) = struct.unpack_from("<f", data, 20)
    frames = last - first + 1
    number = np.dtype("<f4" if scale < 0 else "<i2")
    row = 4 * markers + analogue
    begin = (block - 1) * _BLOCK
    if (
        markers == 0
        or frames < 1
        or not 0 < rate_hz < np.inf
        or begin < 0
        or begin + frames * row * number.itemsize > len(data)
    ):
        raise UserError(f"{path}: no points, or the file is cut short")
    values = np.frombuffer(data, number, frames * row, begin).reshape(frames, row)[:, : 4 * markers]
    values = values.reshape(frames, markers, 4).astype(float)
    unit = (_text_parameter(data, parameters, "POINT", "UNITS") or "mm").lower()
    if unit not in _METRES:
        raise UserError(f"{path}: POINT:UNITS is {unit!r}; expected m, cm or mm")
    position = values[..., :3] * _METRES[unit] * (1.0 if scale < 0 else scale)
    position[(values[..., 3] < 0) | ~np.isfinite(position).all(axis=-1)] = np.nan
    return Points(float(rate_hz), position)


def read_c3d(path: str | Path, markers: list[int] | None = None) -> Mocap:
    """Pose of the rigid body that carries these markers (default: all), where three or more are seen."""
    points = read_points(path)
    position = points.position_m if markers is None else points.position_m[:, markers]
    seen = ~np.isnan(position[..., 0])
    whole = np.flatnonzero(seen.all(axis=1))
    if position.shape[1] < 3 or whole.size == 0:
        raise UserError(f"{path}: needs three markers, all seen in at least one frame")
    layout = position[whole[0]] - position[whole[0]].mean(axis=0)
    t_s, quaternion, centroid = [], [], []
    for i in np.flatnonzero(seen.sum(axis=1) >= 3):
        here, there = layout[seen[i]], position[i, seen[i]]
        turn = Rotation.align_vectors(there - there.mean(axis=0), here - here.mean(axis=0))[0]
        t_s.append(i / points.rate_hz)
        quaternion.append(np.roll(turn.as_quat(), 1))
        centroid.append(there.mean(axis=0) - turn.apply(here.mean(axis=0)))
    return Mocap(np.array(t_s), np.array(quaternion), np.array(centroid))
