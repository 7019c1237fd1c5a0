"""Talking to the drive mock in bytes: lines to its adapter, SDO requests, controlwords."""

import struct

from mock_devices.testing.epos4 import DriveBench


def exchange(bench: DriveBench, lines: bytes) -> bytes:
    """What the adapter says to ``lines``."""
    bench.heard()
    bench.say(lines)
    return bench.heard()


def sdo(bench: DriveBench, request: str) -> str:
    """The node's answer to an SDO request, both as hex."""
    lines = exchange(bench, b"t6018" + request.replace(" ", "").encode() + b"\r").split(b"\r")
    [answer] = [line for line in lines if line.startswith(b"t5818")]
    return answer.removeprefix(b"t5818").decode()


def upload(bench: DriveBench, index: int, sub: int = 0, kind: str = "i") -> int:
    answer = bytes.fromhex(sdo(bench, struct.pack("<BHB4x", 0x40, index, sub).hex()))
    assert answer[0] & 0xE3 == 0x43, answer.hex()
    value: int = struct.unpack_from("<" + kind, answer, 4)[0]
    return value


def download(bench: DriveBench, index: int, sub: int, size: int, value: int) -> int:
    """0, or the abort code."""
    head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
    answer = bytes.fromhex(sdo(bench, (head + (value & 0xFFFFFFFF).to_bytes(4, "little")).hex()))
    return 0 if answer[0] == 0x60 else int(struct.unpack_from("<I", answer, 4)[0])


def status(bench: DriveBench) -> int:
    return upload(bench, 0x6041, kind="H")


def control(bench: DriveBench, *words: int) -> int:
    for word in words:
        assert download(bench, 0x6040, 0, 2, word) == 0
    return status(bench)


def enabled(bench: DriveBench, mode: int) -> None:
    assert download(bench, 0x6060, 0, 1, mode) == 0
    assert control(bench, 0x06, 0x07, 0x0F) & 0x6F == 0x27


def follow(bench: DriveBench, seconds: float, step_s: float = 0.001) -> list[float]:
    """Positions of the carriage while time passes."""
    positions = []
    for _ in range(round(seconds / step_s)):
        bench.run(step_s)
        positions.append(bench.plant.position_mm)
    return positions
