"""The DBC in the tree, with cantools and python-can as the other end of the robot's CAN wire."""

import random
import re
import subprocess

import can
import cantools
import equipoise
import pytest


@pytest.fixture(scope="module")
def database(root):
    return cantools.database.load_file(root / "config/equipoise.dbc")


def frames_of(root, side, message: bytes) -> list[can.Message]:
    """What our encoder makes of a message."""
    said = subprocess.run(
        [root / "build/host/tests/can_frames", "say", side],
        input=message.hex(),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    pairs = [line.split("#") for line in said.splitlines()]
    return [
        can.Message(arbitration_id=int(i, 16), data=bytes.fromhex(data), is_extended_id=False)
        for i, data in pairs
    ]


def heard_by(root, side, frames) -> list[bytes]:
    """What our decoder makes of frames."""
    lines = "".join(f"{f.arbitration_id:03X}#{bytes(f.data).hex()}\n" for f in frames)
    heard = subprocess.run(
        [root / "build/host/tests/can_frames", "hear", side],
        input=lines,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return [bytes.fromhex(line) for line in heard.splitlines()]


def crc(data: bytes) -> int:
    """CRC-16/CCITT as the database's comment says it: polynomial 1021, from FFFF."""
    rest = 0xFFFF
    for byte in data:
        rest ^= byte << 8
        for _ in range(8):
            rest = (rest << 1 ^ 0x1021 if rest & 0x8000 else rest << 1) & 0xFFFF
    return rest


def message_in(stream: bytes) -> bytes:
    assert stream[:2] == b"\xea\x11"
    size = stream[2]
    assert len(stream) == size + 5
    assert int.from_bytes(stream[-2:], "big") == crc(stream[2:-2])
    return stream[3:-2]


def command() -> equipoise.signed_command_t:
    message = equipoise.signed_command_t()
    message.session, message.sequence, message.action = 7, 3, equipoise.signed_command_t.DRIVE
    message.velocity_W_m_s, message.yaw_rate_rad_s = [0.1, -0.2], 0.5
    message.holder, message.mac = b"anna".ljust(16, b"\0"), bytes(range(16))
    return message


def test_the_identifiers_are_those_of_the_firmware(root, database):
    wire = (root / "src/app/run/can_wire.hpp").read_text()
    talkers, to_robot, from_robot = (
        int(re.search(rf"{name} = (\w+);", wire)[1], 0) for name in ("kTalkers", "kToRobot", "kFromRobot")
    )
    names = {message.name: message.frame_id for message in database.messages}
    assert names == {
        f"{name}_{i}": first + i
        for name, first in (("TO_ROBOT", to_robot), ("FROM_ROBOT", from_robot))
        for i in range(talkers)
    }


def test_identifiers_do_not_collide(database):
    identifiers = [message.frame_id for message in database.messages]
    assert len(identifiers) == len(set(identifiers)) == 32
    assert {message.length for message in database.messages} == {8}
    assert {node.name for node in database.nodes} == {"ROBOT", "OWNER"}


@pytest.mark.parametrize(("side", "name"), [("owner", "TO_ROBOT"), ("robot", "FROM_ROBOT")])
def test_another_tool_reads_our_frames_from_a_bus(root, database, side, name):
    sent = command()
    frames = frames_of(root, side, sent.encode())
    stream, names = b"", set()
    with can.Bus("dbc", interface="virtual") as ours, can.Bus("dbc", interface="virtual") as theirs:
        for frame in frames:
            ours.send(frame)
            got = theirs.recv(timeout=5)
            names.add(database.get_message_by_frame_id(got.arbitration_id).name)
            signals = database.decode_message(got.arbitration_id, got.data, allow_truncated=True)
            stream += bytes(int(signals[f"byte_{i}"]) for i in range(got.dlc))
    assert len(names) == 1
    assert names.pop().rpartition("_")[0] == name
    received = equipoise.signed_command_t.decode(message_in(stream))
    assert list(received.velocity_W_m_s) == [0.1, -0.2]
    assert received.holder[:4] == b"anna"


def test_our_wire_reads_what_another_tool_encodes(root, database):
    def encoded(name, stream):
        frames = []
        for at in range(0, len(stream), 8):
            part = stream[at : at + 8]
            signals = {f"byte_{i}": part[i] if i < len(part) else 0 for i in range(8)}
            message = database.get_message_by_name(name)
            data = message.encode(signals)[: len(part)]
            frames.append(can.Message(arbitration_id=message.frame_id, data=data, is_extended_id=False))
        return frames

    message = command().encode()
    stream = b"\xea\x11" + bytes([len(message)]) + message
    stream += crc(stream[2:]).to_bytes(2, "big")
    one, other = encoded("TO_ROBOT_3", stream), encoded("TO_ROBOT_9", stream)
    mixed = [frame for pair in zip(one, other, strict=True) for frame in pair]  # two talk at once
    assert heard_by(root, "robot", mixed) == [message, message]
    assert heard_by(root, "owner", mixed) == []  # not for this side
    damaged = list(one)
    damaged[2].data[random.Random(1).randrange(8)] ^= 0x40
    assert heard_by(root, "robot", damaged) == []
