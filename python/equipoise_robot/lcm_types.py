"""Our LCM types as NumPy structured types: a whole channel decodes in one step.

Layout and fingerprint are read from the .lcm files (scalars and fixed arrays, big-endian, in order), so a
message of another version of a type is recognised instead of misread. Types that hold strings are decoded one
by one.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace

import numpy as np

from ._data import LCM

_SCALARS = {
    "double": ">f8",
    "float": ">f4",
    "int64_t": ">i8",
    "int32_t": ">i4",
    "int16_t": ">i2",
    "int8_t": "i1",
    "byte": "u1",
    "boolean": "?",
}
_STRUCT = re.compile(r"struct\s+(\w+)\s*\{(.*?)\}", re.S)
_FIELD = re.compile(r"(\w+)\s+(\w+)((?:\s*\[\w+\])*)\s*$")
_FIXED_SIZE = 0
_WORD = 1 << 64


@dataclass(frozen=True)
class Field:
    name: str
    type: str
    shape: tuple[int, ...]


def _hashed(value: int, byte: int) -> int:
    """LCM's lcm_struct_hash: on signed 64-bit integers."""
    signed = value - _WORD if value >> 63 else value
    byte = byte - 256 if byte > 127 else byte
    return (((value << 8) ^ (signed >> 55)) + byte) % _WORD


def _hashed_text(value: int, text: str) -> int:
    value = _hashed(value, len(text))
    for byte in text.encode():
        value = _hashed(value, byte)
    return value


@dataclass(frozen=True)
class MessageType:
    name: str
    fields: tuple[Field, ...]

    @property
    def fingerprint(self) -> bytes:
        value = 0x12345678
        for field in self.fields:
            value = _hashed_text(value, field.name)
            value = _hashed_text(value, field.type)
            value = _hashed(value, len(field.shape))
            for size in field.shape:
                value = _hashed(value, _FIXED_SIZE)
                value = _hashed_text(value, str(size))
        rotated = (value << 1 | value >> 63) % _WORD
        return rotated.to_bytes(8, "big")

    @property
    def layout(self) -> np.dtype | None:
        """None: it holds a string and is decoded one by one."""
        if any(field.type == "string" for field in self.fields):
            return None
        return np.dtype([(field.name, _SCALARS[field.type], field.shape) for field in self.fields])

    def decode(self, message: bytes) -> SimpleNamespace:
        """Raises ValueError when its length does not fit."""
        values, at = {}, 8
        try:
            for field in self.fields:
                if field.type == "string":
                    (size,) = struct.unpack_from(">i", message, at)
                    at += 4 + size
                    if size < 1 or at > len(message):
                        raise ValueError(f"a string of a {self.name} is cut off")
                    values[field.name] = message[at - size : at - 1].decode(errors="replace")
                else:
                    dtype = np.dtype((_SCALARS[field.type], field.shape))
                    value = np.frombuffer(message, dtype, count=1, offset=at)[0]
                    values[field.name] = value.tolist()
                    at += dtype.itemsize
        except struct.error:
            raise ValueError(f"a {self.name} is cut off") from None
        if at != len(message):
            raise ValueError(f"a {self.name} has {at} bytes")
        return SimpleNamespace(**values)


def _fields_of(body: str) -> tuple[Field, ...] | None:
    """None: a type that we do not use (variable arrays, nested types)."""
    fields = []
    for statement in re.sub(r"//[^\n]*|/\*.*?\*/", "", body, flags=re.S).split(";"):
        match = _FIELD.search(statement.strip())
        if not match or statement.strip().startswith("const"):
            continue
        sizes = re.findall(r"\[(\w+)\]", match[3])
        scalar = match[1] in _SCALARS or (match[1] == "string" and not sizes)
        if not scalar or not all(size.isdigit() for size in sizes):
            return None
        fields.append(Field(match[2], match[1], tuple(map(int, sizes))))
    return tuple(fields)


@cache
def message_types() -> dict[bytes, MessageType]:
    """By fingerprint, the first eight bytes of a message."""
    types = {}
    for file in sorted(LCM.glob("*.lcm")):
        for name, body in _STRUCT.findall(file.read_text()):
            fields = _fields_of(body)
            if fields is not None:
                kind = MessageType(name, fields)
                types[kind.fingerprint] = kind
    return types


def decode_messages(messages: list[bytes]) -> np.ndarray | None:
    """Messages of one type -> one record array in the machine's byte order; None when the type is unknown.

    A message whose length does not fit its type raises ValueError.
    """
    kind = message_types().get(messages[0][:8])
    if kind is None:
        return None
    layout = kind.layout
    if layout is None:
        decoded = np.empty(len(messages), object)
        decoded[:] = [kind.decode(message) for message in messages]
        return decoded
    wanted = 8 + layout.itemsize
    if any(len(message) != wanted for message in messages):
        raise ValueError(f"a {kind.name} has {wanted} bytes")
    records = np.frombuffer(b"".join(message[8:] for message in messages), layout)
    return records.astype(layout.newbyteorder("="))
