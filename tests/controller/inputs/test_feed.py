"""The loop with its inputs: rows relayed, states shown, a switch that stops, and a needed input that is lost."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from controller.devices.states import DeviceState
from controller.inputs.client import inputs_path
from controller.inputs.commands import WithInputs, with_inputs
from controller.inputs.feed import MOST_ROWS, InputFeed
from controller.inputs.states import INPUT_STATE, InputState, packed
from controller.loop.modes import Mode
from rig.config.products.input_role import brought_by
from rig.config.wiring import Wiring
from rig.input_streams import InputSample, input_streams
from rig.recording.ring import RingReader, RingWriter
from tests.controller.fake_bench import APPROACH, HOLD, LEAVE, PRESS, ZERO, FakeBench

INPUTS = {
    "pedal": {"product": "evdev-switch", "port": "/dev/pedal", "stops": "pain"},
    "marker_key": {"product": "evdev-switch", "port": "/dev/key"},
    "belt": {"product": "lsl-stream", "port": "Belt"},
}
WIRING = Wiring.model_validate({"input": INPUTS})
STREAMS = {stream.name: stream for stream in input_streams(brought_by(WIRING.input))}


@dataclass
class Rows:
    """What the loop relays."""

    found: list[tuple[int, bytes]] = field(default_factory=list)

    def put(self, stream_id: int, body: bytes) -> None:
        self.found.append((stream_id, body))


class InputBench:
    """A loop on a clock in the test's hand, and the ring that the process of the inputs would write."""

    def __init__(self, folder: Path) -> None:
        self.bench, self.rows = FakeBench(), Rows()
        self.ring = RingWriter.create(folder / "a.inputs", 1024)
        feed = InputFeed(WIRING.input, RingReader.open(self.ring.path), self.rows, self.bench.clock.now_ns)
        self.feed = feed
        self.bench.loop._commands = WithInputs(self.bench.loop._commands, feed)
        self.saying: dict[str, tuple[str, str]] = dict.fromkeys(INPUTS, ("ok", ""))
        self.says = True

    def cycles(self, count: int) -> None:
        """With the states that are said every tenth of a second."""
        for number in range(count):
            if self.says and number % 100 == 0:
                self.say()
            self.bench.cycle()

    def say(self) -> None:
        for number, (state, detail) in enumerate(self.saying.values()):
            self.ring.put(INPUT_STATE.id, packed(0, self.bench.clock.now_ns, number, state, detail))

    def press(self, name: str, down: float) -> bytes:
        now_ns = self.bench.clock.now_ns
        sample = InputSample(0, now_ns, now_ns, 0, 0, -1, (down, 48.0), 0, 1)
        body = STREAMS[name].pack(sample.row)
        self.ring.put(STREAMS[name].id, body)
        return body

    def pressing(self) -> None:
        self.cycles(100)
        self.bench.begin(ZERO, APPROACH, PRESS, HOLD)
        for _ in range(100):
            self.cycles(100)
            if self.bench.mode is Mode.COMPRESS:
                return
        raise AssertionError(f"{self.bench.mode.name} {self.bench.latched}")

    def events(self) -> list[str]:
        return [event.text for event in self.bench.ring.events if event.code == "input_state"]


@pytest.fixture
def made(tmp_path: Path) -> InputBench:
    bench = InputBench(tmp_path)
    bench.cycles(200)
    return bench


def test_rows_are_relayed_as_they_are_a_few_a_cycle(made: InputBench) -> None:
    bodies = [made.press("marker_key", 1.0) for _ in range(MOST_ROWS + 5)]
    made.says = False
    made.cycles(1)
    assert len(made.rows.found) == MOST_ROWS
    made.cycles(1)
    assert made.rows.found == [(STREAMS["marker_key"].id, body) for body in bodies]


def test_states_are_shown_beside_the_devices(made: InputBench) -> None:
    made.saying["belt"] = ("lost", "stream 'Belt': is not there")
    made.cycles(200)
    shown = made.bench.link.statuses[-1]["devices"]
    assert shown["pedal"]["state"] == "ok"
    assert (shown["belt"]["state"], shown["belt"]["detail"]) == ("lost", "stream 'Belt': is not there")
    assert "input belt lost: stream 'Belt': is not there" in made.events()


def test_an_input_that_is_not_needed_stops_nothing(made: InputBench) -> None:
    made.pressing()
    made.saying["belt"] = ("lost", "gone")
    made.cycles(3000)
    assert (made.bench.mode, made.bench.latched) == (Mode.COMPRESS, "")


def test_a_needed_input_that_is_lost_retracts_by_name(made: InputBench) -> None:
    made.pressing()
    made.saying["pedal"] = ("reconnecting", "/dev/pedal: the switch is gone")
    made.cycles(200)
    assert made.bench.latched == "input_lost"
    (told,) = made.bench.link.of("incident")
    assert told["text"] == "input pedal is reconnecting: /dev/pedal: the switch is gone"
    made.bench.until(lambda: made.bench.mode is Mode.SAFE)


def test_nothing_begins_without_a_needed_input_but_leaving_the_tissue(made: InputBench) -> None:
    before = made.bench.link.statuses[-1]["ready"]
    made.saying["pedal"] = ("lost", "/dev/pedal: the switch is gone")
    made.cycles(200)
    assert (before, made.bench.link.statuses[-1]["ready"]) == (True, False)
    made.bench.begin(ZERO, APPROACH)
    (answer,) = [said for said in made.bench.link.of("answer") if said["refused"]]
    assert answer["refused"] == "input pedal is lost: /dev/pedal: the switch is gone; without it nothing moves"
    made.bench.begin(LEAVE)
    assert not made.bench.link.of("answer")[-1]["refused"]


def test_without_the_word_of_their_process_a_needed_input_is_lost_within_its_bound(made: InputBench) -> None:
    made.pressing()
    made.says = False
    began_ns = made.bench.clock.now_ns
    made.bench.until(lambda: made.bench.latched == "input_lost", within_s=5.0)
    assert 0.9 < (made.bench.clock.now_ns - began_ns) * 1e-9 < 1.3  # controller.safety.table.INPUT_S
    assert "the process of the inputs says nothing" in made.bench.link.of("incident")[-1]["text"]


def test_a_degraded_switch_still_counts(made: InputBench) -> None:
    made.pressing()
    made.saying["pedal"] = ("degraded", "39 Hz came instead of 50 Hz")
    made.cycles(500)
    assert made.bench.latched == ""


@pytest.mark.parametrize("kind", ["pain", "stop", "emergency"])
def test_a_pressed_switch_is_the_stop_that_its_table_names(tmp_path: Path, kind: str) -> None:
    wiring = Wiring.model_validate({"input": {"pedal": INPUTS["pedal"] | {"stops": kind}}})
    made = InputBench(tmp_path)
    reader = RingReader.open(RingWriter.create(tmp_path / "b.inputs", 64).path)
    feed = InputFeed(wiring.input, reader, made.rows, 0)
    pressed = STREAMS["pedal"].pack(InputSample(0, 1, 1, 0, 0, -1, (1.0, 48.0), 0, 1).row)
    code = {"pain": "pain_stop", "stop": "operator_stop", "emergency": "emergency_stop"}[kind]
    made.pressing()
    made.bench.loop._commands = _With(made.bench.loop._commands, feed._asked(STREAMS["pedal"].id, pressed))
    made.cycles(1)
    assert made.bench.latched == code


class _With:
    """Commands with one more request, once."""

    def __init__(self, commands: Any, request: frozenset[str]) -> None:
        self._commands, self._request = commands, request

    def __getattr__(self, name: str) -> Any:
        return getattr(self._commands, name)

    def collect(self, loop: Any) -> frozenset[str]:
        request, self._request = self._request, frozenset()
        found: frozenset[str] = self._commands.collect(loop)
        return request | found


def test_a_press_stops_and_is_recorded_and_its_release_asks_for_nothing(made: InputBench) -> None:
    made.pressing()
    made.press("pedal", 0.0)
    made.press("marker_key", 1.0)  # a marker alone
    made.cycles(50)
    assert made.bench.latched == ""
    body = made.press("pedal", 1.0)
    made.cycles(2)
    assert made.bench.latched == "pain_stop"
    assert (STREAMS["pedal"].id, body) in made.rows.found


def test_a_damaged_row_of_a_switch_asks_for_nothing(made: InputBench) -> None:
    made.ring.put(STREAMS["pedal"].id, b"\1" * 8)
    made.cycles(2)
    assert made.bench.latched == ""


def test_a_bench_without_inputs_has_its_own_commands(tmp_path: Path) -> None:
    bench = FakeBench()
    commands = bench.loop._commands
    assert with_inputs(commands, Wiring(), Rows(), tmp_path / "a.ring", 0) is commands
    RingWriter.create(inputs_path(tmp_path / "a.ring"), 64)
    assert isinstance(with_inputs(commands, WIRING, Rows(), tmp_path / "a.ring", 0), WithInputs)


def test_a_state_fits_its_slot_whatever_its_detail() -> None:
    body = packed(7, 9, 2, "reconnecting", "ä" * 400)
    assert len(body) < 244
    said = InputState(*INPUT_STATE.unpack(body))
    assert (said.input, DeviceState(said.state), said.detail) == (2, DeviceState.RECONNECTING, "ä" * 75)
