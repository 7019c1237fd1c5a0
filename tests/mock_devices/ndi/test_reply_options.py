"""Every reply option, BX2, user parameters, and what a client may send in small letters or with CR LF."""

import struct

import pytest

from drivers.crc import crc16_arc
from drivers.ndi.codec import BinaryReply, ReplyDecoder, encode_command
from mock_devices.ndi.encoding import SPHERES_MM
from tests.mock_devices.ndi.test_mock import NdiClient

# ARM stands at (-250, 100, -1500) without rotation; of its spheres the second is at (0, 28.6, 41) in its own frame.
SECOND_SPHERE_OF_ARM = (-250.0, 128.6, -1459.0)
# TIP is turned by the quaternion (0.5, -0.5, 0.5, -0.5), which takes (x, y, z) to (z, -x, -y), and stands at
# (12.25, -34.5, -1000).
SECOND_SPHERE_OF_TIP = (12.25 + 41.0, -34.5, -1000.0 - 28.6)


@pytest.fixture
def tracking() -> NdiClient:
    client = NdiClient()
    client.track()
    return client


def bx_body(client: NdiClient, params: str, name: str = "BX") -> bytes:
    (wire,) = client.raw(encode_command(name, params))
    (reply,) = ReplyDecoder().feed(wire)
    assert isinstance(reply, BinaryReply)
    return reply.body


def test_tx_has_each_block_in_the_order_of_the_options(tracking: NdiClient) -> None:
    tracking.mock.strays = [(1.0, -2.0, 3.5)]
    text = tracking.ask("TX:100F")
    tip, arm, rest = text[2:].split("\n")
    transform, information, single, markers = arm[2:69], arm[69:91], arm[91:98], arm[98:]
    assert transform.startswith("+10000+00000+00000+00000-025000+010000-150000+02500")
    assert information == "00" + "0" * 16 + "3333"
    assert single == "MISSING"
    assert markers.startswith("040" + "-025000+010000-150000" + "-025000+012860-145900")
    assert len(markers) == 3 + 4 * 21
    assert tip[98:].startswith("040+001225-003450-100000+005325-003450-102860")
    assert rest == "010+000100-000200+000350" + "0000"


def test_bx_has_each_block_in_the_order_of_the_options(tracking: NdiClient) -> None:
    tracking.mock.strays = [(1.0, -2.0, 3.5)] * 9
    tracking.mock.missing = {0}
    body = bx_body(tracking, "100f")
    assert body[:3] == bytes((2, 1, 2))
    tip = body[3 : 3 + 8 + 11 + 1 + 1]
    assert tip[8:] == bytes(11) + b"\0\0"
    arm = body[3 + len(tip) :]
    assert arm[:2] == bytes((2, 1))
    assert arm[42 : 42 + 11] == bytes(9) + b"\x33\x33"
    assert arm[53:56] == b"\0\x04\0"
    assert struct.unpack_from("<3f", arm, 56 + 12) == pytest.approx(SECOND_SPHERE_OF_ARM, abs=1e-3)
    strays = arm[56 + 48 :]
    assert strays[:3] == b"\x09\0\0"
    assert struct.unpack_from("<3f", strays, 3 + 8 * 12) == (1.0, -2.0, 3.5)
    assert len(strays) == 3 + 9 * 12 + 2


@pytest.mark.parametrize("options", ["0002", "0004", "0008", "0800", "1000", "8001", "0801", "180F"])
def test_every_combination_of_options_is_answered_by_both(tracking: NdiClient, options: str) -> None:
    assert not tracking.ask(f"TX:{options}").startswith("ERROR")
    assert bx_body(tracking, options)[0] == 2


def components(data: bytes) -> dict[int, tuple[int, bytes]]:
    """A container of the general binary format, read by its published layout: items and bytes by type."""
    version, count = struct.unpack_from("<HH", data)
    assert version == 1
    at, found = 4, {}
    for _ in range(count):
        kind, size, _option, items = struct.unpack_from("<HIHI", data, at)
        found[kind] = (items, data[at + 12 : at + size])
        at += size
    assert at == len(data)
    return found


def test_bx2_is_a_frame_with_transforms_and_markers(tracking: NdiClient) -> None:
    tracking.mock.missing = {1}
    tracking.mock.strays = [(7.0, 8.0, 9.0)]
    (items, frame) = components(bx_body(tracking, "--6d=tools --3d=all", "BX2"))[1]
    assert items == 1
    kind, sequence, status, number, seconds, _rest = struct.unpack_from("<BBHIII", frame)
    assert (kind, sequence, status, number, seconds) == (2, 0, 0, 1, 0)
    inner = components(frame[16:])
    assert sorted(inner) == [2, 3]
    tools, transforms = inner[2]
    assert tools == 2
    assert struct.unpack_from("<HH8f", transforms) == (1, 0, 0.5, -0.5, 0.5, -0.5, 12.25, -34.5, -1000.0, 0.125)
    assert struct.unpack_from("<HH", transforms, 36) == (2, 0x010D)
    assert len(transforms) == 40
    groups, positions = inner[3]
    assert groups == 2
    assert struct.unpack_from("<HHBBH3f", positions, 0)[:2] == (1, len(SPHERES_MM))
    assert struct.unpack_from("<BBH3f", positions, 4 + 16) == pytest.approx((0, 0, 1, *SECOND_SPHERE_OF_TIP), abs=1e-3)
    assert struct.unpack_from("<HHBBH3f", positions, 4 + 4 * 16) == (0xFFFF, 1, 0, 0, 0, 7.0, 8.0, 9.0)


def test_bx2_takes_its_options_without_a_checksum_and_refuses_others(tracking: NdiClient) -> None:
    (wire,) = tracking.raw(b"BX2 --3d=strays\r")
    (reply,) = ReplyDecoder().feed(wire)
    assert isinstance(reply, BinaryReply)
    assert tracking.ask("BX2:--6d=everything") == "ERROR23"
    assert tracking.ask("BX2:--7d=tools") == "ERROR23"
    tracking.ask("TSTOP:")
    assert tracking.ask("BX2:") == "ERROR0C"


def test_an_unplugged_tool_is_told_as_such_by_bx2(tracking: NdiClient) -> None:
    tracking.mock.unplugged = {0}
    frame = components(bx_body(tracking, "", "BX2"))[1][1]
    assert struct.unpack_from("<HH", components(frame[16:])[2][1]) == (1, 0x0121)


@pytest.mark.parametrize(("kind", "revision"), [("vega", "G.003.005"), ("polaris", "D.001.007")])
def test_the_revision_of_the_interface_is_told_before_init(kind: str, revision: str) -> None:
    assert NdiClient(kind=kind).ask("APIREV:") == revision


def test_user_parameters_are_read_written_and_guarded() -> None:
    client = NdiClient()
    assert client.ask("GET:Param.Tracking.Frame Frequency") == "Param.Tracking.Frame Frequency=60"
    assert client.raw(b"SET Param.Tracking.Frame Frequency=20\r")[0].startswith(b"OKAY")
    assert client.ask("GET:Param.Tracking.F*") == "Param.Tracking.Frame Frequency=20"
    assert client.ask("GET:Param.Tracking.*").count("\n") == 2
    assert client.ask("SET:Param.Tracking.Frame Frequency=61") == "ERROR36"
    assert client.ask("SET:Param.Tracking.Frame Frequency=fast") == "ERROR35"
    assert client.ask("SET:Features.Firmware.Version=1") == "ERROR39"
    assert client.ask("SET:Param.Nothing=1") == "ERROR34"
    assert client.ask("GET:") == "ERROR34"
    assert client.ask("GETINFO:Param.Tracking.Frame*").startswith("Param.Tracking.Frame Frequency=20;3;3;20;60;")


def test_small_hexadecimal_letters_are_taken_as_the_makers_own_library_sends_them() -> None:
    client = NdiClient()
    assert client.raw(b"INIT:e3a5\r") == [b"OKAYA896\r"]
    assert client.ask("PHRQ:*********1****") == "03"
    line = b"PVWR:03" + b"03c0" + b"ab" * 64
    assert client.raw(line + b"%04x\r" % crc16_arc(line)) == [b"OKAYA896\r"]


def test_cr_lf_ends_a_command_as_cr_does() -> None:
    client = NdiClient()
    assert client.raw(b"INIT:E3A5\r\nVER 4\r\n") == [b"OKAYA896\r", *NdiClient().raw(b"VER 4\r")]
    assert client.raw(b"\nINIT \r") == [b"OKAYA896\r"]


def test_init_frees_what_was_loaded_and_what_is_plugged_in_is_offered_anew() -> None:
    client = NdiClient()
    client.track()
    assert client.ask("TSTOP:") == "OKAY"
    client.ask("PHRQ:*********1****")
    assert client.ask("PHSR:00").startswith("03")
    client.ask("INIT:")
    assert client.ask("PHSR:00") == client.ask("PHSR:02") == "020100102001"
    client.ask("PHRQ:*********1****")
    client.mock.keeps_handles = True
    client.ask("INIT:")
    assert client.ask("PHSR:00").startswith("03")
