"""The tracker mock answers as a tracker does, command by command, on a wire in memory."""

from typing import Any

import pytest

from drivers.ndi import replies
from drivers.ndi.codec import BinaryReply, ReplyDecoder, TextReply, encode_command
from mock_devices.ndi.mock import MAX_COMMAND, NdiMock
from mock_devices.testing.ndi import ARM, TIP, StillPlant
from mock_devices.testing.wire import MemoryWire
from mock_devices.wire import PtyWire, TcpWire


class NdiClient:
    """A client that sends one command and reads one reply."""

    def __init__(self, **kind: Any) -> None:
        self.wire = MemoryWire()
        self.plant = StillPlant()
        self.mock = NdiMock(self.wire, self.plant, start_ns=0, **kind)

    def raw(self, data: bytes) -> list[bytes]:
        self.wire.said += data
        self.mock.receive(self.mock.due_ns)
        written, self.wire.sent = self.wire.sent, []
        return written

    def ask(self, command: str) -> str:
        """``NAME:params`` in, text out, both without checksum."""
        name, _, params = command.partition(":")
        (wire,) = self.raw(encode_command(name, params))
        (reply,) = ReplyDecoder().feed(wire)
        assert isinstance(reply, TextReply)
        return reply.text

    def bx(self, options: str = "0001") -> replies.TrackingReply:
        (wire,) = self.raw(encode_command("BX", options))
        (reply,) = ReplyDecoder().feed(wire)
        assert isinstance(reply, BinaryReply)
        parsed = replies.parse_bx(reply.body, int(options, 16))
        assert parsed is not None
        return parsed

    def frame(self) -> None:
        self.mock.tick(self.mock.due_ns)

    def track(self) -> None:
        for command in ("INIT:", "PINIT:01", "PINIT:02", "PENA:01D", "PENA:02D", "TSTART:"):
            assert self.ask(command) == "OKAY"
        self.frame()


@pytest.fixture
def client() -> NdiClient:
    return NdiClient()


@pytest.fixture
def tracking() -> NdiClient:
    client = NdiClient()
    client.track()
    return client


def test_init_is_answered_in_the_manuals_bytes(client: NdiClient) -> None:
    assert client.raw(b"INIT:E3A5\r") == [b"OKAYA896\r"]


def test_a_command_with_a_space_needs_no_checksum(client: NdiClient) -> None:
    assert client.raw(b"INIT \r") == [b"OKAYA896\r"]
    assert client.raw(b"PHSR 02\r") == [b"020100102001C741\r"]


def test_a_command_with_a_colon_needs_the_right_checksum(client: NdiClient) -> None:
    assert client.raw(b"INIT:E3A6\r") == client.raw(b"INIT:\r")
    assert b"ERROR04" in client.raw(b"INIT:E3A6\r")[0]


def test_a_reset_forgets_everything(tracking: NdiClient) -> None:
    assert tracking.raw(b"RESET 0\r") == [b"RESETBE6F\r"]
    assert tracking.ask("PHSR:00") == "ERROR10"
    tracking.ask("INIT:")
    assert tracking.ask("PHSR:02") == "020100102001"


def test_a_command_may_come_in_pieces_and_two_in_one(client: NdiClient) -> None:
    assert client.raw(b"INIT:E3") == []
    assert client.raw(b"A5\rVER:065EE\r")[0] == b"OKAYA896\r"


def test_each_reply_is_one_write(client: NdiClient) -> None:
    assert len(client.raw(b"INIT:E3A5\rINIT:E3A5\rVER:065EE\r")) == 3


@pytest.mark.parametrize("line", [b"?", b"\xff\x00", b"", b"init"])
def test_what_is_no_command_is_refused(client: NdiClient, line: bytes) -> None:
    assert client.raw(line + b"\r")[0].startswith(b"ERROR01")


def test_an_endless_command_is_refused_and_kept_short(client: NdiClient) -> None:
    for _ in range(100):
        assert client.raw(b"X" * MAX_COMMAND) == []
    assert len(client.mock._input) == MAX_COMMAND + 1
    assert client.raw(b"\r")[0].startswith(b"ERROR02")
    assert client.ask("INIT:") == "OKAY"


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("PHSR:00", "ERROR10"),  # system not initialised
        ("TX:0001", "ERROR10"),
        ("NOSUCH:", "ERROR01"),
        ("VER:9", "ERROR07"),
        ("GETINFO:Param.Nothing", "ERROR34"),
        ("COMM:9", "ERROR07"),
    ],
)
def test_before_init_little_is_allowed(client: NdiClient, command: str, error: str) -> None:
    assert client.ask(command) == error


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("TX:0001", "ERROR0C"),  # not tracking
        ("BX:0001", "ERROR0C"),
        ("TSTOP:", "ERROR0C"),
        ("PHSR:09", "ERROR23"),  # out of range
        ("PHRQ:*", "ERROR07"),  # parameters
        ("PINIT:09", "ERROR08"),  # no such handle
        ("PINIT:G", "ERROR07"),
        ("PENA:01D", "ERROR0E"),  # not initialised
        ("PENA:01X", "ERROR09"),  # priority
        ("PVWR:010000", "ERROR07"),
        ("PVWR:010400" + "00" * 64, "ERROR23"),  # beyond the definition
        ("PVWR:010000" + "00" * 64, "ERROR2F"),  # a wired tool has its own
        ("PHF:09", "ERROR08"),
        ("PHINF:010100", "ERROR23"),
        ("TSTART:11", "ERROR07"),
    ],
)
def test_in_setup_each_mistake_has_its_error(client: NdiClient, command: str, error: str) -> None:
    client.ask("INIT:")
    assert client.ask(command) == error


@pytest.mark.parametrize("command", ["PINIT:01", "PENA:01D", "PDIS:01", "PHF:01", "TSTART:", "COMM:50000"])
def test_while_tracking_ports_are_left_alone(tracking: NdiClient, command: str) -> None:
    assert tracking.ask(command) == "ERROR0C"


@pytest.mark.parametrize("command", ["TX:0010", "BX:0021", "TX:4001", "BX:0000"])
def test_reply_options_it_does_not_have_are_refused(tracking: NdiClient, command: str) -> None:
    assert tracking.ask(command) == "ERROR23"


def test_handles_go_from_found_to_initialised_to_enabled(client: NdiClient) -> None:
    client.ask("INIT:")
    assert client.ask("PHSR:02") == "020100102001"
    client.ask("PINIT:01")
    assert (client.ask("PHSR:02"), client.ask("PHSR:03")) == ("0102001", "0101011")
    client.ask("PENA:01D")
    assert (client.ask("PHSR:03"), client.ask("PHSR:04")) == ("00", "0101031")
    client.ask("PDIS:01")
    assert client.ask("PHSR:03") == "0101011"
    assert client.ask("PHSR:00") == "020101102001"


def test_a_definition_written_to_a_new_handle_follows_the_first_tool(client: NdiClient) -> None:
    client.ask("INIT:")
    assert client.ask("PHRQ:*********1****") == "03"
    assert client.ask("PINIT:03") == "ERROR0D"
    for address in range(0, 1024, 64):
        assert client.ask(f"PVWR:03{address:04X}{'A5' * 64}") == "OKAY"
    for command in ("PINIT:03", "PENA:03D", "TSTART:"):
        assert client.ask(command) == "OKAY"
    client.frame()
    (tool,) = client.bx().tools
    assert isinstance(tool.pose, replies.Pose)
    assert (tool.handle, tool.pose.x_mm) == (3, TIP.x_mm)


def test_handles_run_out(client: NdiClient) -> None:
    client.ask("INIT:")
    handles = [client.ask("PHRQ:*********1****") for _ in range(23)]
    assert handles[-1] == "ERROR2D"
    assert client.ask(f"PHF:{handles[0]}") == "OKAY"
    assert client.ask("PHRQ:*********1****") == handles[0]


def test_a_handle_asked_for_and_not_filled_is_stale(client: NdiClient) -> None:
    client.ask("INIT:")
    client.ask("PHRQ:*********1****")
    assert client.ask("PHSR:01") == "0103000"


def test_a_tool_is_described_in_the_manuals_33_characters(client: NdiClient) -> None:
    client.ask("INIT:")
    assert client.ask("PHINF:010001") == "02000000tissue-rig  0010000000101"
    assert client.ask("PHINF:01") == client.ask("PHINF:010001")
    assert client.ask("PHINF:010004") == "tip                 "
    assert len(client.ask("PHINF:010025")) == 33 + 20 + 14
    client.mock.unplugged = {0}
    assert client.ask("PHINF:010001") == "UNOCCUPIED"


def test_bx_and_tx_report_the_markers_of_the_plant(tracking: NdiClient) -> None:
    assert replies.parse_tx(tracking.ask("TX:0001")) == tracking.bx()
    tip, arm = tracking.bx().tools
    assert tip.pose == (0.5, -0.5, 0.5, -0.5, 12.25, -34.5, -1000.0, 0.125)
    assert isinstance(arm.pose, replies.Pose)
    assert (arm.pose.x_mm, arm.port_status) == (ARM.x_mm, 0x31)


def test_stray_markers_may_be_asked_for_and_there_are_none(tracking: NdiClient) -> None:
    assert replies.parse_tx(tracking.ask("TX:1001"), 0x1001) == tracking.bx("1001") == tracking.bx("0801")


def test_the_frame_number_advances_at_60_Hz_in_every_mode(client: NdiClient) -> None:
    instants = []
    for _ in range(61):
        instants.append(client.mock.due_ns)
        client.frame()
    assert instants[-1] - instants[0] == 1_000_000_000
    client.track()
    assert client.bx().tools[0].frame == 62


def test_the_frame_number_may_be_set_to_zero_at_the_start(client: NdiClient) -> None:
    client.track()
    client.ask("TSTOP:")
    client.ask("TSTART:80")
    assert client.bx().tools[0].frame == 0


def test_what_the_camera_does_not_see_is_missing(tracking: NdiClient) -> None:
    tracking.plant.view = [None]
    tracking.frame()
    assert [tool.pose for tool in tracking.bx().tools] == ["MISSING", "MISSING"]
    assert [tool.frame for tool in tracking.bx().tools] == [2, 2]


def test_faults_are_set_while_running(tracking: NdiClient) -> None:
    tracking.mock.missing = {0}
    assert [isinstance(tool.pose, str) for tool in tracking.bx().tools] == [True, False]
    tracking.mock.unplugged = {1}
    assert [tool.pose for tool in tracking.bx().tools] == ["MISSING", "DISABLED"]
    assert tracking.bx().system_status == 0x0080
    tracking.mock.frozen = True
    frame = tracking.bx().tools[0].frame
    tracking.frame()
    assert tracking.bx().tools[0].frame == frame
    tracking.mock.error_reply = 0x11
    assert tracking.ask("BX:0001") == "ERROR11"
    tracking.mock.silent = True
    assert tracking.raw(b"INIT:E3A5\r") == []


def test_every_nth_reply_is_damaged_where_asked(client: NdiClient) -> None:
    client.mock.corrupt_every = 3
    written = client.raw(b"INIT:E3A5\r" * 6)
    assert [wire == b"OKAYA896\r" for wire in written] == [True, True, False, True, True, False]


def test_a_pulled_tool_cannot_be_disabled_as_on_a_polaris(tracking: NdiClient) -> None:
    tracking.ask("TSTOP:")
    tracking.mock.unplugged = {1}
    assert tracking.ask("PDIS:02") == "ERROR08"
    assert tracking.ask("PHF:02") == "OKAY"
    assert tracking.ask("PHSR:00") == "0101031"


def test_it_tells_by_which_kind_of_port_it_is_reached() -> None:
    for wire, kind in ((PtyWire(), "serial"), (TcpWire(), "tcp")):
        mock = NdiMock(wire, StillPlant(), start_ns=0)
        assert mock.endpoints() == {kind: wire.endpoint}
        assert mock.filenos() == wire.filenos()
        mock.close()


def test_a_connection_has_no_speed_to_set() -> None:
    wire = TcpWire()
    mock = NdiMock(wire, StillPlant(), start_ns=0, kind="polaris")
    with pytest.raises(Exception, match="ERROR01"):
        mock._communication("50000")
    assert mock.freeze_tag == "POLARIS Rev 021"
    mock.close()
