"""Our LCM types as NumPy structured types: a whole channel decodes in one step.

The layout is read from lcm/*.lcm (scalars and fixed arrays, big-endian, in order), the fingerprint from the
generated Python class, so a message of another version of a type is recognised instead of misread.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

import numpy as np

from .paths import import_lcm_types, repository_root

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


@dataclass(frozen=True)
class MessageType:
    name: str
    fingerprint: bytes
    layout: np.dtype | None  # None: it holds a string or a variable array and is decoded one by one
    decode: object


def layout_of(body: str) -> np.dtype | None:
    fields = []
    for statement in re.sub(r"//[^\n]*|/\*.*?\*/", "", body, flags=re.S).split(";"):
        match = _FIELD.search(statement.strip())
        if not match or statement.strip().startswith("const"):
            continue
        sizes = re.findall(r"\[(\w+)\]", match[3])
        if match[1] not in _SCALARS or not all(size.isdigit() for size in sizes):
            return None
        fields.append((match[2], _SCALARS[match[1]], tuple(map(int, sizes))))
    return np.dtype(fields)


@cache
def message_types() -> dict[bytes, MessageType]:
    """By fingerprint, the first eight bytes of a message."""
    package = import_lcm_types()
    types = {}
    for file in sorted((repository_root() / "lcm").glob("*.lcm")):
        for name, body in _STRUCT.findall(file.read_text()):
            generated = getattr(package, name, None)
            if generated is not None:
                fingerprint = generated._get_packed_fingerprint()
                types[fingerprint] = MessageType(name, fingerprint, layout_of(body), generated.decode)
    return types


def decode_messages(messages: list[bytes]) -> np.ndarray | None:
    """Messages of one type -> one record array in the machine's byte order; None when the type is unknown.

    A message whose length does not fit its type raises ValueError.
    """
    kind = message_types().get(messages[0][:8])
    if kind is None:
        return None
    if kind.layout is None:
        decoded = np.empty(len(messages), object)
        decoded[:] = [kind.decode(message) for message in messages]
        return decoded
    wanted = 8 + kind.layout.itemsize
    if any(len(message) != wanted for message in messages):
        raise ValueError(f"a {kind.name} has {wanted} bytes")
    records = np.frombuffer(b"".join(message[8:] for message in messages), kind.layout)
    return records.astype(kind.layout.newbyteorder("="))
