import json
import random
import select
import socket
import threading
import tomllib
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import mock_devices
from mock_devices.control import BenchControl, ControlPort, ControlRequest, RequestHandler
from mock_devices.faults.wires import WIRE_FAULTS, FaultyWire, faults_of
from mock_devices.parameters import Parameters, load_parameters
from mock_devices.quantities import QUANTITIES, read, write
from mock_devices.wire import PtyWire
from rig.channel import Frame, Parser, encode
from rig.errors import DeviceError, RigError, UsageError
from tests.mock_devices.playing import MS_NS, quiet_bench, settle


@pytest.fixture
def wire() -> Iterator[FaultyWire]:
    wire = FaultyWire(PtyWire(), random.Random(0), lambda: 0)
    yield wire
    wire.close()


@pytest.fixture
def handler(wire: FaultyWire) -> RequestHandler:
    return RequestHandler(quiet_bench(), {"force": [faults_of(wire, WIRE_FAULTS)]})


def ask(handler: RequestHandler, request: dict[str, Any]) -> dict[str, Any]:
    ((verb, argument),) = request.items()
    try:
        return dict(json.loads(json.dumps({verb: handler.answer(verb, argument)})))
    except RigError as error:
        return {"error": str(error)}


def test_figures_are_read_by_name(handler: RequestHandler) -> None:
    assert ask(handler, {"get": ["tip.force_N", "axis.position_mm", "time_s", "tissue.present"]}) == {
        "get": {"tip.force_N": 0.0, "axis.position_mm": 5.0, "time_s": 0.0, "tissue.present": True}
    }


def test_every_quantity_that_can_be_set_sets_an_attribute_that_there_is() -> None:
    bench = quiet_bench()
    parts = [bench, *(part for part in vars(bench).values() if hasattr(part, "__dict__"))]
    attributes = [set(vars(part)) for part in parts]
    for name in (name for name, quantity in QUANTITIES.items() if quantity.write):
        write(bench, name, read(bench, name))
    assert [set(vars(part)) for part in parts] == attributes


def test_times_at_which_the_drive_was_synced_are_told_once() -> None:
    handler = RequestHandler(quiet_bench(), {}, deque(range(1200)))
    assert ask(handler, {"synced_ns": True})["synced_ns"] == list(range(1000))
    assert ask(handler, {"synced_ns": True})["synced_ns"] == list(range(1000, 1200))
    assert ask(handler, {"synced_ns": True})["synced_ns"] == []


def test_times_at_which_a_sensor_took_its_samples_are_told_once() -> None:
    handler = RequestHandler(quiet_bench(), {}, sampled={"force": deque([(7, 10**12), (8, 10**12 + 1)])})
    assert ask(handler, {"sampled": "force"})["sampled"] == [[7, 10**12], [8, 10**12 + 1]]
    assert ask(handler, {"sampled": "force"})["sampled"] == []
    assert "force" in ask(handler, {"sampled": "forse"})["error"]


def test_the_limb_is_moved_stiffened_and_removed_while_running() -> None:
    bench = quiet_bench()
    handler = RequestHandler(bench, {})
    settle(bench, 25.0)
    rest_N = bench.contact_N
    ask(handler, {"set": {"tissue.stiffness_scale": 2.0}})
    bench.advance(bench.now_ns + 1000 * MS_NS)
    assert bench.contact_N == pytest.approx(2 * rest_N, rel=1e-3)
    ask(handler, {"set": {"surface.position_mm": 23.0}})
    bench.advance(bench.now_ns + 1000 * MS_NS)
    assert ask(handler, {"get": ["surface.position_mm"]})["get"] == {"surface.position_mm": 23.0}
    assert 0 < bench.contact_N < rest_N
    assert ask(handler, {"set": {"tissue.present": False}}) == {"set": {"tissue.present": False}}
    bench.advance(bench.now_ns + 10 * MS_NS)
    assert ask(handler, {"get": ["tip.force_N"]})["get"] == {"tip.force_N": 0.0}


def test_every_dial_can_be_read_and_says_what_it_is(handler: RequestHandler) -> None:
    meanings = ask(handler, {"quantities": True})["quantities"]
    assert set(ask(handler, {"get": list(meanings)})["get"]) == set(meanings)
    assert all(meanings.values())


def test_truth_is_told_when_asked_and_effects_are_switched(handler: RequestHandler) -> None:
    assert ask(handler, {"truth": True}) == {"truth": {}}
    assert ask(handler, {"hide": {"friction.level_N": 0.2, "backlash": None}}) == {"hide": ["backlash", "friction"]}
    assert ask(handler, {"truth": True}) == {
        "truth": {"backlash": {"gap_mm": 0.3}, "friction": {"level_N": 0.2, "slip_length_mm": 0.05}}
    }
    assert ask(handler, {"hide": {}}) == {"hide": []}


def test_a_fault_takes_its_default_or_a_value(handler: RequestHandler, wire: FaultyWire) -> None:
    assert ask(handler, {"fault": {"device": "force", "kind": "drop"}}) == {
        "fault": {"device": "force", "kind": "drop", "value": 0.1}
    }
    assert wire.drop_share == 0.1
    ask(handler, {"fault": {"device": "force", "kind": "delay", "value": 0.5}})
    assert wire.delay_s == 0.5
    assert set(ask(handler, {"faults": True})["faults"]["force"]) == set(WIRE_FAULTS)


@pytest.mark.parametrize(
    ("request_", "sentence"),
    [
        ({"get": ["tip.force"]}, "unknown quantity 'tip.force'; nearest valid quantity: tip.force_N"),
        ({"get": "time_s"}, "get takes a list of names"),
        ({"set": {"tip.force_N": 1}}, "unknown settable quantity 'tip.force_N'"),
        ({"set": {"surface.position_mm": 900}}, "surface.position_mm = 900 is outside -50 to 150"),
        ({"set": {"surface.position_mm": "up"}}, "takes a number, not 'up'"),
        ({"set": {"surface.position_mm": float("nan")}}, "takes a number, not nan"),
        ({"set": {"tissue.present": 1}}, "true or false"),
        ({"set": [1]}, "set takes an object of names and values"),
        ({"hide": {"fricton.level_N": 0.2}}, "nearest valid effect: friction"),
        ({"fault": {"device": "force", "kind": "snip"}}, "unknown fault of force 'snip'"),
        ({"fault": {"device": "laser", "kind": "cut"}}, "unknown device 'laser'; nearest valid device: force"),
        ({"fault": {"device": "force", "kind": "drop", "value": 7}}, "a number from 0 to 1"),
        ({"gett": []}, "unknown request 'gett'; nearest valid request: get"),
    ],
)
def test_a_wrong_request_is_answered_by_one_sentence(
    handler: RequestHandler, request_: dict[str, Any], sentence: str
) -> None:
    assert sentence in ask(handler, request_)["error"]


@contextmanager
def answered(handler: RequestHandler) -> Iterator[str]:
    """The control port of ``handler``, waited on by another thread."""
    port, ended = ControlPort(handler.answer), threading.Event()

    def wait() -> None:
        while not ended.is_set():
            if select.select(port.filenos(), [], [], 0.02)[0]:
                port.receive()

    thread = threading.Thread(target=wait)
    thread.start()
    try:
        yield port.endpoint
    finally:
        ended.set()
        thread.join()
        port.close()


def test_the_client_sets_gets_and_raises_what_the_bench_says(handler: RequestHandler, wire: FaultyWire) -> None:
    with answered(handler) as address, BenchControl(address) as control, BenchControl(address) as other:
        assert control.set({"tissue.stiffness_scale": 3.0}) == {"tissue.stiffness_scale": 3.0}
        assert other.number("tissue.stiffness_scale") == 3.0
        assert control.hide({"friction": None}) == ["friction"]
        assert control.truth()["friction"]["level_N"] == 0.2
        control.fault("force", "drop", 0.5)
        assert wire.drop_share == 0.5
        assert "cut" in control.faults()["force"]
        assert control.synced_ns() == []
        with pytest.raises(UsageError, match="nearest valid quantity: time_s"):
            control.get("time")


def test_a_request_may_come_in_pieces_and_what_is_none_is_refused(handler: RequestHandler) -> None:
    with answered(handler) as address:
        host, _, number = address.partition(":")
        with socket.create_connection((host, int(number)), 5) as client:
            frame = encode(7, ControlRequest.TYPE, b'{"verb": "get", "argument": ["time_s"]}')
            client.sendall(b"no frame at all, and longer than the head of one")
            client.sendall(frame[:9])
            client.sendall(frame[9:] + encode(8, ControlRequest.TYPE, b"no JSON") + encode(9, 77, b"{}"))
            parser, frames = Parser(), list[Frame]()
            while len(frames) < 3:
                frames += parser.feed(client.recv(1000))
    said = {body["to"]: body for body in (json.loads(frame.body) for frame in frames)}
    assert said[7] == {"to": 7, "value": {"time_s": 0.0}}
    assert all(said[number]["refused"] for number in (8, 9))


def test_a_bench_that_ends_is_said(handler: RequestHandler) -> None:
    with answered(handler) as address:
        control = BenchControl(address)
        control.get("time_s")
    with pytest.raises(DeviceError, match="the bench hung up"):
        control.get("time_s")
    control.close()


def test_no_bench_is_a_sentence() -> None:
    with pytest.raises(DeviceError, match="no bench answers there"):
        BenchControl("127.0.0.1:1")
    with pytest.raises(DeviceError, match="no bench answers there"):
        BenchControl("nowhere")


def test_the_documented_file_is_complete_and_says_the_defaults() -> None:
    path = Path(mock_devices.__file__).parent / "default.toml"
    assert load_parameters(path) == Parameters()
    written = tomllib.loads(path.read_text())
    expected = Parameters().model_dump()
    del expected["hide"]
    assert {section: set(values) for section, values in written.items()} == {
        section: set(values) for section, values in expected.items()
    }
