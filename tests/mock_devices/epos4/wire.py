"""Talking to the drive mock in bytes: lines to its adapter, SDO requests, controlwords."""

import struct

from mock_devices.testing.epos4 import DriveBench


def exchange(stage: DriveBench, lines: bytes) -> bytes:
    """What the adapter says to ``lines``."""
    stage.heard()
    stage.say(lines)
    return stage.heard()


def sdo(stage: DriveBench, request: str) -> str:
    """The node's answer to an SDO request, both as hex."""
    lines = exchange(stage, b"t6018" + request.replace(" ", "").encode() + b"\r").split(b"\r")
    [answer] = [line for line in lines if line.startswith(b"t5818")]
    return answer.removeprefix(b"t5818").decode()


def upload(stage: DriveBench, index: int, sub: int = 0, kind: str = "i") -> int:
    answer = bytes.fromhex(sdo(stage, struct.pack("<BHB4x", 0x40, index, sub).hex()))
    assert answer[0] & 0xE3 == 0x43, answer.hex()
    value: int = struct.unpack_from("<" + kind, answer, 4)[0]
    return value


def download(stage: DriveBench, index: int, sub: int, size: int, value: int) -> int:
    """0, or the abort code."""
    head = struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub)
    answer = bytes.fromhex(sdo(stage, (head + (value & 0xFFFFFFFF).to_bytes(4, "little")).hex()))
    return 0 if answer[0] == 0x60 else int(struct.unpack_from("<I", answer, 4)[0])


def status(stage: DriveBench) -> int:
    return upload(stage, 0x6041, kind="H")


def control(stage: DriveBench, *words: int) -> int:
    for word in words:
        assert download(stage, 0x6040, 0, 2, word) == 0
    return status(stage)


def enabled(stage: DriveBench, mode: int) -> None:
    assert download(stage, 0x6060, 0, 1, mode) == 0
    assert control(stage, 0x06, 0x07, 0x0F) & 0x6F == 0x27


def follow(stage: DriveBench, seconds: float, step_s: float = 0.001) -> list[float]:
    """Positions of the carriage while time passes."""
    positions = []
    for _ in range(round(seconds / step_s)):
        stage.run(step_s)
        positions.append(stage.plant.position_mm)
    return positions
