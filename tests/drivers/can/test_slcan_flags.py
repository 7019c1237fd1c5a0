"""What an SLCAN adapter says of its bus when it is asked once a second; one that has no answer is not asked again."""

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from drivers.can.bus import FLAGS_NS, SlcanLink
from drivers.can.health import BusHealth, BusState
from drivers.can.slcan import Flags, decode_flags
from mock_devices.can.slcan_adapter import BEL, SlcanAdapter
from mock_devices.wire import PtyWire

PATIENCE_S = 5.0
ERRORS = Flags.PASSIVE | Flags.BUS_ERROR


@pytest.mark.parametrize(
    ("line", "flags"),
    [(b"F00", Flags(0)), (b"FA4", Flags.BUS_ERROR | Flags.PASSIVE | Flags.WARNING), (b"F0a", Flags(0x0A)),
     (b"F", None), (b"F0", None), (b"F000", None), (b"FXX", None), (b"V1013", None)],
)  # fmt: skip
def test_flags_are_those_of_the_manual(line: bytes, flags: Flags | None) -> None:
    assert decode_flags(line) == flags


@pytest.mark.parametrize(
    ("flags", "state", "errors", "dropped"),
    [
        (0x00, BusState.ACTIVE, 0, 0),
        (0x01, BusState.ACTIVE, 0, 1),
        (0x02, BusState.ACTIVE, 0, 0),
        (0x04, BusState.WARNING, 0, 0),
        (0x08, BusState.ACTIVE, 0, 1),
        (0x20, BusState.PASSIVE, 0, 0),
        (0x24, BusState.PASSIVE, 0, 0),
        (0x40, BusState.ACTIVE, 0, 0),
        (0x80, BusState.PASSIVE, 1, 0),
    ],
)
def test_each_flag_has_its_meaning_for_a_bus_that_was_passive(
    flags: int, state: BusState, errors: int, dropped: int
) -> None:
    """An error alone changes no state: the controller told of that when it changed."""
    health = BusHealth(1_000_000, state=BusState.PASSIVE)
    health.flagged(Flags(flags))
    assert (health.state, health.error_frames, health.dropped) == (state, errors, dropped)


class Later:
    """The computer's clock, and what a test lets pass at once."""

    def __init__(self) -> None:
        self.by_ns = 0

    def __call__(self) -> int:
        return time.monotonic_ns() + self.by_ns


class Answering(SlcanAdapter):
    """An adapter that says something else to F."""

    def __init__(self, answer: bytes) -> None:
        super().__init__(PtyWire())
        self.answer, self.asked = answer, 0

    def _command(self, command: bytes, argument: bytes) -> bytes:
        self.asked += command == b"F"
        return self.answer if command == b"F" else super()._command(command, argument)


Serve = Callable[[SlcanAdapter], SlcanLink]


@pytest.fixture
def later() -> Later:
    return Later()


@pytest.fixture
def serve(later: Later) -> Iterator[Serve]:
    """Opens the adapter, which is played until the end of the test."""
    ending, links = threading.Event(), list[SlcanLink]()
    players = list[threading.Thread]()

    def served(adapter: SlcanAdapter) -> SlcanLink:
        def play() -> None:
            while not ending.wait(0.001):
                adapter.receive()
                adapter.flush()
            adapter.wire.close()

        players.append(threading.Thread(target=play))
        players[-1].start()
        links.append(SlcanLink(adapter.wire.endpoint, 1_000_000, later))
        return links[-1]

    yield served
    for link in links:
        link.close()
    ending.set()
    for player in players:
        player.join()


def until(link: SlcanLink, condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s, link.health.summary
        link.wait(0.01)
        link.read()


def test_errors_of_the_bus_show_within_a_second_and_cease(serve: Serve, later: Later) -> None:
    adapter = SlcanAdapter(PtyWire())
    link = serve(adapter)
    adapter.flags = ERRORS
    link.read()
    time.sleep(0.05)
    assert adapter.flags == ERRORS, "it was asked before a second had passed"
    later.by_ns += FLAGS_NS
    until(link, lambda: link.health.state is BusState.PASSIVE)
    assert link.health.error_frames == 1
    assert link.health.trouble == "the CAN bus is error passive: check bit rate, terminators and cable"
    later.by_ns += FLAGS_NS
    until(link, lambda: link.health.state is BusState.ACTIVE)
    assert (link.health.trouble, link.health.refused) == ("", 0)


def test_what_was_before_it_was_opened_does_not_count(serve: Serve, later: Later) -> None:
    adapter = SlcanAdapter(PtyWire())
    adapter.flags = ERRORS
    link = serve(adapter)
    later.by_ns += FLAGS_NS
    adapter.flags = Flags.OVERRUN
    until(link, lambda: link.health.dropped == 1)
    assert (link.health.state, link.health.error_frames) == (BusState.ACTIVE, 0)


@pytest.mark.parametrize("answer", [BEL, b"", b"A0\r", b"t70121F00\r"])
def test_an_adapter_that_knows_no_flags_is_asked_once(serve: Serve, later: Later, answer: bytes) -> None:
    """One refuses, one is silent, one has flags of its own, and on the bus of one a frame ends like an answer."""
    adapter = Answering(answer)
    link = serve(adapter)
    for _ in range(5):
        later.by_ns += FLAGS_NS
        link.read()
        time.sleep(0.01)
    assert (adapter.asked, link.health.refused, link.health.state) == (1, 0, BusState.ACTIVE)
