"""``python -m benchmarks.fuzz``: random, mutated and spliced strings into every codec; what is no answer is a crash.

Each string goes to one codec, the codecs in turn. A third of them are random, the others are real messages with bits
turned, bytes cut, doubled, or put between those of another. A codec may return anything, or raise what its caller
expects of it; everything else is a crash, and is printed with the string that makes it, in hexadecimal.
"""

import argparse
import random
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from drivers.bota import codec as bota
from drivers.can.slcan import SlcanDecoder, decode_line
from drivers.can.socketcan import decode as decode_can
from drivers.canopen.nmt import decode_emergency, decode_heartbeat
from drivers.canopen.sdo import Download, Upload
from drivers.cia402.eds import parse_eds
from drivers.epos4.codec import decode_motion_pdo, decode_state_pdo
from drivers.ndi import codec as ndi
from drivers.ndi import replies
from drivers.ndi.replies import Pose, ToolReading
from drivers.robotiq import codec as robotiq
from drivers.roles import LinkCounters
from mock_devices.bota.mock import CommandParser
from mock_devices.canopen.sdo_server import SdoServer
from mock_devices.epos4.dictionary import Dictionary
from mock_devices.epos4.table import EPOS4
from mock_devices.ndi.encoding import Scene, encode_bx, encode_tx
from mock_devices.ndi.gbf import parse_request
from mock_devices.ndi.mock import parse_command
from mock_devices.ndi.port_handles import CommandRefused
from rig.errors import UsageError

LONGEST = 200  # of a random string: twice the longest message but a tool's list
POSE = Pose(0.5, -0.5, 0.5, -0.5, 12.25, -34.5, -1000.0, 0.125)
SCENE = Scene([ToolReading(1, POSE, 0x31, 500), ToolReading(2, "MISSING", 0x31, 500), ToolReading(3, "DISABLED")])
CAN = """
4018100100000000 43181001fb000000 4108100005000000 0545504f53340000 8040600002000106 1186800000000000 6000000000000000
237a6000d2040000 01060000080000004018100100000000 40000020080000000000000000000000
"""
TEXTS = (
    b"t58184318100100000000\r", b"T0123456780011\rz\rZ\r", b"V1013\rNA123\r\aF00\r", b"r,0,C,0\r\n",
    b"c,0,1,0,4f,512,0,0,1", b"App Init\r\nname: BFT-SENS-SER-M8\r\nS/N: 000271\r\nFW version: 1.0.6\r\n",
    b"INIT:E3A5\r", b"BX 0801\r", b"BX2 --6d=tools --3d=all\r", b"OKAYA896\r",
    b"Features.Firmware.Version=007.000.012;3;1;0;12;;Current firmware",
    b"[6040]\nParameterName=Controlword\nObjectType=0x7\nDataType=0x0006\nAccessType=rww\nPDOMapping=1\n",
    b"[DeviceInfo]\nVendorNumber=0xFB\n[1400sub1]\nDataType=7\nDefaultValue=$NODEID+0x200\n",
    b"[2100]\nDataType=4\nCompactSubObj=3\nLowLimit=-5\n",
)  # fmt: skip
EXAMPLES = (
    robotiq.encode_frame([0, 1, 2, 3, 4, 5]),
    bota.encode_frame(bota.ForceFrame(0, 1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 10_000, 25.0)),
    *map(bytes.fromhex, CAN.split()),
    *TEXTS,
    ndi.encode_command("PHSR", "00"),
    ndi.encode_text("ERROR0C"),
    ndi.encode_text("02010310002033"),
    encode_tx(SCENE, 0x100F).encode(),
    ndi.encode_text(encode_tx(SCENE)),
    ndi.encode_binary(encode_bx(SCENE, 0x100F)),
    encode_bx(SCENE),
)


class Codec(NamedTuple):
    """One codec: what takes the string, and what it may raise."""

    take: Callable[[bytes], object]
    may_raise: tuple[type[Exception], ...] = ()


def _replies(data: bytes) -> None:
    text = data.decode("latin-1")
    for parse in (replies.parse_tx, replies.parse_handles, replies.parse_handle, replies.parse_error,
                  replies.parse_version, replies.parse_info):  # fmt: skip
        parse(text)
    replies.parse_bx(data)
    replies.parse_bx(data, replies.TRANSFORMS | replies.STRAYS)


def _canopen(data: bytes) -> None:
    for transfer in (Upload(0x1018, 1), Download(0x607A, 0, bytes(20))):
        for at in range(0, len(data), 8):
            transfer.feed(data[at : at + 8])
    decode_emergency(data)
    decode_heartbeat(data)
    decode_state_pdo(data)
    decode_motion_pdo(data)


def _server() -> Callable[[bytes], object]:
    dictionary = Dictionary(1, EPOS4)
    server = SdoServer(dictionary.read, dictionary.write)
    return lambda data: [server.answer(data[at : at + 8]) for at in range(0, len(data), 8)]


def codecs() -> dict[str, Codec]:
    """Every codec by name, stateful ones new."""
    parser, lines, tracker = CommandParser(), SlcanDecoder(), ndi.ReplyDecoder()
    return {
        "bota frames": Codec(bota.make_decoder(LinkCounters()).feed),
        "bota text": Codec(lambda data: (bota.find_ack(data, b"C"), bota.find_boot_text(data))),
        "bota commands": Codec(lambda data: list(parser.feed(data))),
        "robotiq frames": Codec(robotiq.make_decoder(LinkCounters()).feed),
        "slcan stream": Codec(lines.feed),
        "slcan line": Codec(decode_line),
        "socketcan": Codec(lambda data: [decode_can(data[at : at + 16]) for at in range(0, len(data), 16)]),
        "canopen": Codec(_canopen),
        "sdo server": Codec(_server()),
        "eds": Codec(lambda data: parse_eds(data.decode("latin-1"), "fuzz"), (UsageError,)),
        "ndi stream": Codec(tracker.feed),
        "ndi replies": Codec(_replies),
        "ndi commands": Codec(parse_command, (CommandRefused,)),
        "ndi bx2": Codec(lambda data: parse_request(data.decode("latin-1")), (CommandRefused,)),
    }


def a_string(rng: random.Random) -> bytes:
    """Random, or an example spoilt in one of a few ways."""
    kind = rng.randrange(6)
    if kind < 2:
        return rng.randbytes(rng.randrange(LONGEST))
    example = bytearray(rng.choice(EXAMPLES))
    at = rng.randrange(len(example))
    if kind == 2:
        for _ in range(rng.randrange(1, 5)):
            example[rng.randrange(len(example))] ^= 1 << rng.randrange(8)
        return bytes(example)
    if kind == 3:
        return bytes(example[at:] if rng.random() < 0.5 else example[:at])
    other = rng.choice(EXAMPLES)
    return bytes(example[:at]) + other + bytes(example[at:]) if kind == 4 else bytes(example) * rng.randrange(2, 5)


class Crash(NamedTuple):
    """What made which codec raise what."""

    codec: str
    string: bytes
    error: str


def run(count: int, seed: int, tried: Mapping[str, Codec]) -> list[Crash]:
    """``count`` strings, dealt out to the codecs in turn."""
    rng = random.Random(seed)
    named = list(tried.items())
    crashes = []
    for number in range(count):
        name, codec = named[number % len(named)]
        string = a_string(rng)
        try:
            codec.take(string)
        except codec.may_raise:
            continue
        except Exception as error:  # the point of it
            crashes.append(Crash(name, string, f"{type(error).__name__}: {error}"))
    return crashes


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints how many strings and crashes there were; 1 where there was a crash."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=100_000, help="strings; default: 100000")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    begun = time.monotonic()
    tried = codecs()
    crashes = run(options.count, options.seed, tried)
    for crash in crashes[:20]:
        print(f"{crash.codec}: {crash.error} on {crash.string.hex()}")
    print(
        f"{options.count} strings, {len(tried)} codecs, seed {options.seed}: {len(crashes)} crashes in "
        f"{time.monotonic() - begun:.0f} s"
    )
    return int(bool(crashes))


if __name__ == "__main__":
    sys.exit(main())
