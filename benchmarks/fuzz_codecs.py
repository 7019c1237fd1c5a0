"""Every codec of drivers, mocks and the example plug-in, and real messages of each protocol; `benchmarks.fuzz` uses it.

`tests/benchmarks/test_fuzz.py` fails where a function that takes bytes apart is reached by none of them.
"""

import importlib.util
import math
import struct
from collections.abc import Callable
from functools import cache
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from drivers.bota import codec as bota
from drivers.can.slcan import CanFrame, SlcanDecoder, decode_flags, decode_line, encode_frame
from drivers.can.socketcan import decode as decode_can
from drivers.canopen.nmt import decode_emergency, decode_heartbeat
from drivers.canopen.sdo import Download, Upload
from drivers.cia402.eds import parse_eds
from drivers.cia402.kind import SheetKind
from drivers.epos4.codec import decode_state_pdo
from drivers.epos4.kind import Epos4Kind
from drivers.epos4.objects import OBJECTS
from drivers.evdev.codec import EventParser, event
from drivers.firmata import codec as firmata
from drivers.laumas import codec as laumas
from drivers.ndi import codec as ndi
from drivers.ndi import replies
from drivers.ndi.replies import Pose, ToolReading
from drivers.openigtlink import codec as igtl
from drivers.optitrack import packets
from drivers.optitrack.frames import decode_frame
from drivers.optitrack.models import decode_models
from drivers.poses import ToolPose
from drivers.robotiq import codec as robotiq
from drivers.roles import LinkCounters
from drivers.zaber.codec import LineDecoder, ZaberReply, encode_command, encode_reply
from mock_devices.bench import Bench
from mock_devices.bota.mock import BotaMock, CommandParser
from mock_devices.canopen.sdo_server import SdoServer
from mock_devices.epos4.dictionary import Dictionary
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.epos4.table import EPOS4
from mock_devices.firmata.glove import GlovePlant
from mock_devices.firmata.mock import BoardRequests, FirmataMock
from mock_devices.interfaces import MarkerPose, ProtocolMock
from mock_devices.laumas.mock import LaumasMock
from mock_devices.ndi.encoding import Scene, encode_bx, encode_tx
from mock_devices.ndi.gbf import parse_request
from mock_devices.ndi.mock import NdiMock, parse_command
from mock_devices.ndi.port_handles import CommandRefused
from mock_devices.openigtlink.mock import OpenIgtLinkMock
from mock_devices.optitrack.mock import OptiTrackMock
from mock_devices.optitrack.packets import frame, models, server_information
from mock_devices.parameters import Parameters
from mock_devices.robotiq.mock import RequestFinder, RobotiqMock
from mock_devices.testing.epos4 import LaggingPlant
from mock_devices.testing.wire import MemoryWire
from mock_devices.zaber.commands import CommandLines
from mock_devices.zaber.mock import ZaberMock
from rig.config.products.cia402 import Cia402Wiring
from rig.errors import DeviceError, UsageError

NUMBERS = {entry.kind: entry for entry in OBJECTS.values() if entry.size}
PLUGIN = Path(__file__).parents[1] / "examples/plugin-netft/src/rig_netft/netft.py"
VERSIONS: tuple[packets.Version, ...] = ((3, 0), (4, 0), (4, 1))
POSE = Pose(0.5, -0.5, 0.5, -0.5, 12.25, -34.5, -1000.0, 0.125)
SCENE = Scene([ToolReading(1, POSE, 0x31, 500), ToolReading(2, "MISSING", 0x31, 500), ToolReading(3, "DISABLED")])
TOOL = ToolPose(12.25, -34.5, -1000.0, 0.5, -0.5, 0.5, -0.5, 0.125)
MARKER = MarkerPose(12.25, -34.5, -1000.0, 0.5, -0.5, 0.5, -0.5, 0.125)
# Answers and requests of SDO, PDOs, an emergency and a heartbeat, and frames of SocketCAN.
CAN = """
4018100100000000 43181001fb000000 4108100005000000 0545504f53340000 8040600002000106 1186800000000000 6000000000000000
237a6000d2040000 01060000080000004018100100000000 40000020080000000000000000000000
"""
SHEETS = (
    b"[6040]\nParameterName=Controlword\nObjectType=0x7\nDataType=0x0006\nAccessType=rww\nPDOMapping=1\n",
    b"[DeviceInfo]\nVendorNumber=0xFB\n[1400sub1]\nDataType=7\nDefaultValue=$NODEID+0x200\n",
    b"[2100]\nDataType=4\nCompactSubObj=3\nLowLimit=-5\n",
)
OF_SLCAN = (b"t58184318100100000000\r", b"T0123456780011\rz\rZ\r", b"V1013\rNA123\r\aF00\r")
OF_CAN = tuple(map(bytes.fromhex, CAN.split()))
OF_BOTA = (
    bota.encode_frame(bota.ForceFrame(0, 1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 10_000, 25.0)),
    b"r,0,C,0\r\n", b"c,0,1,0,4f,512,0,0,1",
    b"App Init\r\nname: BFT-SENS-SER-M8\r\nS/N: 000271\r\nFW version: 1.0.6\r\n",
)  # fmt: skip
# The last one starts the stream, as Robotiq's own driver asks for it.
OF_ROBOTIQ = (
    robotiq.encode_frame([0, 1, 2, 3, 4, 5]), bytes.fromhex("0903020046d9b7"), bytes.fromhex("0910019a0001020200cdca"),
)  # fmt: skip
OF_NDI = (
    b"INIT:E3A5\r", b"BX 0801\r", b"BX2 --6d=tools --3d=all\r", b"OKAYA896\r",
    b"Features.Firmware.Version=007.000.012;3;1;0;12;;Current firmware",
    ndi.encode_command("PHSR", "00"), ndi.encode_text("ERROR0C"), ndi.encode_text("02010310002033"),
    encode_tx(SCENE, 0x100F).encode(), ndi.encode_text(encode_tx(SCENE)),
    ndi.encode_binary(encode_bx(SCENE, 0x100F)), encode_bx(SCENE),
)  # fmt: skip
OF_ZABER = (
    encode_command(1, 1, 7, "move abs 50000"), encode_command(1, 0, 8, ""),
    encode_reply(ZaberReply("@", 1, 1, 7, True, True, "WR", "0")),
    encode_reply(ZaberReply("@", 1, 0, 8, False, False, "--", "BADDATA"), with_checksum=False),
    encode_reply(ZaberReply("!", 1, 1, None, True, False, "FS", "")),
    encode_reply(ZaberReply("#", 1, 0, None, True, False, "--", "a note")),
)  # fmt: skip
# Five registers: status 0, gross -25,000, net 10; and an exception.
OF_LAUMAS = (
    robotiq.with_crc(bytes.fromhex("01030a0000ffff9e580000000a")), robotiq.with_crc(bytes.fromhex("018302")),
    laumas.encode_read(1, laumas.STATUS, laumas.WEIGHTS_COUNT),
)  # fmt: skip
OF_FIRMATA = (
    firmata.reading(2, 421), firmata.sampling_interval(20), firmata.report(2, True), b"\xf9\x02\x05",
    firmata.sysex(firmata.FIRMWARE, b"\x02\x05S\x00t\x00"), firmata.sysex(firmata.MAPPING, b"\x7f\x7f\x00\x01"),
)  # fmt: skip
OF_EVDEV = (event(10**18, 1, 48, 1), event(10**18, 4, 4, 7), event(10**18, 1, 48, 2))
OF_IGTLINK = (
    igtl.encode("TRANSFORM", "tip", igtl.encode_transform(TOOL), 1_700_000_000_000_000_000),
    igtl.encode("TDATA", "Tracker", igtl.encode_tools([("tip", TOOL), ("arm", TOOL)]), version=igtl.WITH_EXTENDED),
    igtl.encode(igtl.START_TDATA, "tissue-rig", igtl.encode_start(16)), igtl.encode_start(16),
)  # fmt: skip
OF_OPTITRACK = tuple(
    whole
    for version in VERSIONS
    for message, content in (
        (packets.FRAME, frame(5, (MARKER, None), 123_456, version)),
        (packets.MODELS, models(("tip", "arm"), version)),
        (packets.SERVER_INFO, server_information(version, 1511)),
    )
    for whole in (packets.encode_packet(message, content), content)
)
# Of ATI's manual: the request for a stream, and a record of six counts.
OF_NETFT = (bytes.fromhex("1234000200000000"), struct.pack(">IIIiiiiii", 5, 35_007, 0, 10**6, -2, 3, 4, -5, 6))
# What outlasts one answer of a mock drive and a mock axis: modes, words, resets; numbers that are none.
DRIVE = """
2f60600008000000 2f60600006000000 2b40600006000000 2b4060000f000000 2b4060001f000000 237a6000d2040000 8101 0101
"""
OF_DRIVE = tuple(
    encode_frame(CanFrame(0x601 if len(data) == 8 else 0, data)) for data in map(bytes.fromhex, DRIVE.split())
)
OF_ZABER_MOVES = (
    b"/1 move abs 5000\n", b"/1 move abs 1 nan\n", b"/1 move vel nan\n", b"/1 move vel inf\n", b"/1 home\n",
    b"/1 stop\n", b"/1 set maxspeed 0\n", b"/1 set accel 0\n", b"/1 set limit.max inf\n",
    b"/1 get limit.max\n", b"/1 get pos\n",
)  # fmt: skip
OF_NDI_PARAMETERS = (b"SET Param.Simulated Alerts=5\r", b"SET Param.Simulated Alerts=\xb2\r", b"GET Param.*\r")
OF_NETFT_PAGE = (
    b"<netft><cfgcalsn>FT27462</cfgcalsn><scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><cfgcpf>1000</cfgcpf><cfgcpt>2</cfgcpt>",
    b"<scfgfu>lbf</scfgfu>", b"<cfgcpf>0</cfgcpf>", b"<cfgcpt>nan</cfgcpt>", b"<cfgcpf>1e999</cfgcpf>",
)  # fmt: skip
EXAMPLES = tuple(
    chain(OF_BOTA, OF_ROBOTIQ, OF_SLCAN, OF_CAN, SHEETS, OF_NDI, OF_ZABER, OF_LAUMAS, OF_FIRMATA, OF_EVDEV,
          OF_IGTLINK, OF_OPTITRACK, OF_NETFT)
)  # fmt: skip


class Codec(NamedTuple):
    """One codec: what takes the string, what it may raise, and messages of its protocol."""

    take: Callable[[bytes], object]
    may_raise: tuple[type[Exception], ...] = ()
    examples: tuple[bytes, ...] = ()


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


def _drives() -> Callable[[bytes], object]:
    of_sheet = SheetKind(Cia402Wiring(), parse_eds(SHEETS[0].decode(), "fuzz"))
    numbers = [entry.unpack for entry in NUMBERS.values()]
    takes = (decode_state_pdo, Epos4Kind.decode_motion, of_sheet.decode_motion, *numbers)
    return lambda data: [take(data[:size]) for take in takes for size in (4, 6, 8, len(data))]


def _server() -> Callable[[bytes], object]:
    dictionary = Dictionary(1, EPOS4)
    server = SdoServer(dictionary.read, dictionary.write)
    return lambda data: [server.answer(data[at : at + 8]) for at in range(0, len(data), 8)]


def _robotiq(data: bytes) -> None:
    robotiq.refusal(data)
    robotiq.is_intact(data)


def _laumas() -> Callable[[bytes], object]:
    decoder = laumas.AnswerDecoder(1, LinkCounters())

    def take(data: bytes) -> None:
        for answer in decoder.feed(data):
            if len(answer.registers) == laumas.WEIGHTS_COUNT:
                laumas.decode_weights(answer.registers)

    return take


def _firmata() -> Callable[[bytes], object]:
    parser = firmata.FirmataParser(LinkCounters())

    def take(data: bytes) -> None:
        for message in parser.feed(data):
            if isinstance(message, firmata.Sysex):
                firmata.firmware_of(message.data)
                firmata.analog_channels(message.data)

    return take


def _igtlink() -> Callable[[bytes], object]:
    decoder = igtl.MessageDecoder(LinkCounters())

    def take(data: bytes) -> None:
        for message in decoder.feed(data):
            igtl.tools_in(message)
            igtl.decode_resolution_ms(message.content)
        igtl.decode_resolution_ms(data)
        igtl.tools_in(igtl.TimedMessage("TDATA", "fuzz", 0, igtl.PLAIN, data))
        igtl.tools_in(igtl.TimedMessage("TRANSFORM", "fuzz", 0, igtl.PLAIN, data[:48]))

    return take


def _each_version(take: Callable[[bytes, packets.Version], object]) -> Callable[[bytes], object]:
    """Each version gets the string, whatever another makes of it."""

    def each(data: bytes) -> None:
        for version in VERSIONS:
            try:
                take(data, version)
            except packets.BadPacket:
                continue

    return each


def _switch() -> Callable[[bytes], object]:
    changes, presses = EventParser(), EventParser()
    return lambda data: (changes.changes(data), presses.feed(data))


def _netft_page(data: bytes) -> None:
    """A scale that is no number above zero is as bad as a crash: force would be nothing, or of the wrong sign."""
    scale = _netft().scale_of(data.decode("latin-1"), "ati-netft")
    assert 0 < scale.N < math.inf and 0 < scale.N_m < math.inf


@cache
def _netft() -> ModuleType:
    """The example plug-in, which is a distribution of its own and need not be installed."""
    spec = importlib.util.spec_from_file_location("fuzzed_netft", PLUGIN)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def codecs() -> dict[str, Codec]:
    """Every codec by name, stateful ones new."""
    return {**_of_lines(), **_of_can(), **_of_trackers(), **_of_mocks(), **_of_whole_mocks()}


def _of_lines() -> dict[str, Codec]:
    return {
        "bota frames": Codec(bota.make_decoder(LinkCounters()).feed, (), OF_BOTA),
        "bota text": Codec(lambda data: (bota.find_ack(data, b"C"), bota.find_boot_text(data)), (), OF_BOTA),
        "robotiq frames": Codec(robotiq.make_decoder(LinkCounters()).feed, (), OF_ROBOTIQ),
        "robotiq answers": Codec(_robotiq, (), OF_ROBOTIQ),
        "laumas answers": Codec(_laumas(), (), OF_LAUMAS),
        "zaber lines": Codec(LineDecoder(LinkCounters()).feed, (), OF_ZABER),
        "firmata": Codec(_firmata(), (), OF_FIRMATA),
        "input events": Codec(_switch(), (), OF_EVDEV),
        "netft records": Codec(_netft().parse, (), OF_NETFT),
        "netft page": Codec(_netft_page, (DeviceError,), OF_NETFT_PAGE),
    }


def _of_can() -> dict[str, Codec]:
    frames = OF_SLCAN + OF_CAN
    return {
        "slcan stream": Codec(SlcanDecoder().feed, (), frames),
        "slcan line": Codec(decode_line, (), frames),
        "slcan flags": Codec(decode_flags, (), (b"F00", b"F84", *frames)),
        "socketcan": Codec(lambda data: [decode_can(data[at : at + 16]) for at in range(0, len(data), 16)], (), frames),
        "canopen": Codec(_canopen, (), OF_CAN),
        "drives": Codec(_drives(), (), OF_CAN),
        "eds": Codec(lambda data: parse_eds(data.decode("latin-1"), "fuzz"), (UsageError,), SHEETS),
    }


def _of_trackers() -> dict[str, Codec]:
    bad = (packets.BadPacket,)
    return {
        "ndi stream": Codec(ndi.ReplyDecoder().feed, (), OF_NDI),
        "ndi replies": Codec(_replies, (), OF_NDI),
        "openigtlink": Codec(_igtlink(), (), OF_IGTLINK),
        "optitrack datagrams": Codec(packets.split, bad, OF_OPTITRACK),
        "optitrack server": Codec(packets.decode_server, bad, OF_OPTITRACK),
        "optitrack frames": Codec(_each_version(decode_frame), (), OF_OPTITRACK),
        "optitrack models": Codec(_each_version(decode_models), (), OF_OPTITRACK),
    }


def _of_mocks() -> dict[str, Codec]:
    commands, requests, board = CommandParser(), RequestFinder(), BoardRequests()
    lines = CommandLines()
    return {
        "bota commands": Codec(lambda data: list(commands.feed(data)), (), OF_BOTA),
        "modbus requests": Codec(lambda data: list(requests.feed(data)), (), OF_ROBOTIQ + OF_LAUMAS),
        "firmata requests": Codec(lambda data: list(board.feed(data)), (), OF_FIRMATA),
        "zaber commands": Codec(lambda data: list(lines.feed(data)), (), OF_ZABER),
        "sdo server": Codec(_server(), (), OF_CAN),
        "ndi commands": Codec(parse_command, (CommandRefused,), OF_NDI),
        "ndi bx2": Codec(lambda data: parse_request(data.decode("latin-1")), (CommandRefused,), OF_NDI),
    }


def _whole(make: Callable[[MemoryWire], ProtocolMock], first: bytes = b"") -> Callable[[bytes], object]:
    """A mock behind a wire, which hears each string after ``first``, and does what is due in the millisecond after."""
    wire, now_ns = MemoryWire(), 0
    mock = make(wire)

    def take(data: bytes) -> None:
        nonlocal now_ns
        now_ns += 1_000_000
        wire.said += first + data
        mock.receive(now_ns)
        if mock.due_ns <= now_ns:
            mock.tick(now_ns)
        wire.sent.clear()

    return take


def _of_whole_mocks() -> dict[str, Codec]:
    """What answers without a codec of its own; one that raises ends the simulated bench."""
    bench, tools = Bench(Parameters()), ("tip", "arm")
    return {
        "bota mock": Codec(_whole(lambda wire: BotaMock(wire, bench.force, 0)), (), OF_BOTA),
        "robotiq mock": Codec(_whole(lambda wire: RobotiqMock(wire, bench.force_modbus, 0)), (), OF_ROBOTIQ),
        "laumas mock": Codec(_whole(lambda wire: LaumasMock(wire, bench.force)), (), OF_LAUMAS),
        "firmata mock": Codec(_whole(lambda wire: FirmataMock(wire, GlovePlant(), 0)), (), OF_FIRMATA),
        "zaber mock": Codec(
            _whole(lambda wire: ZaberMock(wire, LaggingPlant(), 0, 2000.0, 1), b"\n"), (), OF_ZABER + OF_ZABER_MOVES
        ),
        "epos4 mock": Codec(
            _whole(lambda wire: Epos4Mock(wire, LaggingPlant(), 0), b"\rC\rS8\rO\r"), (), OF_SLCAN + OF_DRIVE
        ),
        "ndi mock": Codec(
            _whole(lambda wire: NdiMock(wire, bench.tracker, 0, tools), b"\r"), (), OF_NDI + OF_NDI_PARAMETERS
        ),
        "optitrack mock": Codec(_whole(lambda wire: OptiTrackMock(wire, bench.tracker, 0, tools)), (), OF_OPTITRACK),
        "openigtlink mock": Codec(
            _whole(lambda wire: OpenIgtLinkMock(wire, bench.tracker, tools, lambda now_ns: now_ns)), (), OF_IGTLINK
        ),
    }
