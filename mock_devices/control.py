"""The bench's control channel: requests over TCP on this machine, on the framed channel of `rig.channel`.

A request is a verb and its argument, and is answered with a value, or with a sentence where it cannot be fulfilled::

    set       {"surface.position_mm": 22.0, "tissue.present": false}    {...as they are now}
    get       ["tip.force_N", "time_s"]                                 {"tip.force_N": 1.2, "time_s": 8.0}
    quantities true                                                     {name: meaning}
    fault     {"device": "force", "kind": "drop", "value": 0.2}         {...}; value may be left out
    faults    true                                                      {device: {kind: meaning}}
    hide      {"friction.level_N": 0.2}                                 [names]; {} none, null defaults
    truth     true                                                      {effect: {parameter: value}}
    synced_ns true                                                      [times]; each is said once
    sampled   "force"                                                   [[mark, time]]; each is said once
"""

import contextlib
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from select import select
from types import TracebackType
from typing import Any, Self, TypeVar

from pydantic import JsonValue
from pydantic_core import to_jsonable_python

from mock_devices import quantities
from mock_devices.bench import Bench
from mock_devices.faults.wires import Fault, Value
from mock_devices.physics.effects import parse_hidden
from rig.channel import Answer, Channel, Message, Received, Reply
from rig.errors import DeviceError, RigError, UsageError
from rig.registry import known

CLIENT_TIMEOUT_S = 10.0  # ten times what a bench may be late by before it gives up (`serve.GIVE_UP_NS`)
TIMES_AT_ONCE = 1000  # a second of 1 kHz: some 30 kB of JSON, a tenth of the largest message
Time = TypeVar("Time")

Faults = Mapping[str, Sequence[Mapping[str, Fault]]]
Sampled = Mapping[str, deque[tuple[int, int]]]


class ControlRequest(Message, kind=50):
    """A request."""

    verb: str
    argument: JsonValue


class ControlReply(Reply, kind=51):
    """Its answer."""

    value: JsonValue


class RequestHandler:
    """Answers requests on ``bench`` and on the ``faults`` of its devices; knows no sockets."""

    def __init__(
        self, bench: Bench, faults: Faults, synced_ns: deque[int] | None = None, sampled: Sampled | None = None
    ) -> None:
        self._bench = bench
        self._sampled = sampled or {}
        self._synced_ns = deque[int]() if synced_ns is None else synced_ns
        self._faults = faults
        self._verbs: dict[str, Callable[[Any], Any]] = {
            "set": self._set,
            "get": self._get,
            "quantities": lambda _: {name: one.meaning for name, one in quantities.QUANTITIES.items()},
            "fault": self._fault,
            "faults": lambda _: self._list_faults(),
            "hide": self._hide,
            "truth": lambda _: self._bench.hidden,
            "synced_ns": lambda _: _said_once(self._synced_ns),
            "sampled": lambda role: _said_once(self._sampled[known(str(role), self._sampled, "sensor")]),
        }

    def answer(self, verb: str, argument: Any) -> Any:
        """What the request asks for; raises RigError where it cannot be fulfilled."""
        return self._verbs[known(verb, self._verbs, "request")](argument)

    def _set(self, values: object) -> dict[str, Value]:
        wanted = _table(values, "set")
        for name, value in wanted.items():
            quantities.write(self._bench, name, value)
        return self._get(list(wanted))

    def _get(self, names: object) -> dict[str, Value]:
        if not isinstance(names, list):
            raise UsageError('get takes a list of names, for example {"get": ["tip.force_N"]}')
        return {str(name): quantities.read(self._bench, str(name)) for name in names}

    def _hide(self, values: object) -> list[str]:
        wanted = _table(values, "hide").items()
        self._bench.hide(parse_hidden(name if value is None else f"{name}={value}" for name, value in wanted))
        return list(self._bench.hidden)

    def _fault(self, values: object) -> dict[str, JsonValue]:
        request = _table(values, "fault")
        device = known(str(request.get("device", "")), self._faults, "device")
        kind = known(str(request.get("kind", "")), self._faults[device][0], f"fault of {device}")
        value = request.get("value", self._faults[device][0][kind].default)
        for faults in self._faults[device]:
            faults[kind].apply(value)
        return {"device": device, "kind": kind, "value": value}

    def _list_faults(self) -> dict[str, dict[str, str]]:
        return {
            device: {kind: fault.meaning for kind, fault in lines[0].items()} for device, lines in self._faults.items()
        }


def _said_once(times: deque[Time]) -> list[Time]:
    return [times.popleft() for _ in range(min(len(times), TIMES_AT_ONCE))]


def _table(values: object, verb: str) -> Mapping[str, Any]:
    if not isinstance(values, dict):
        raise UsageError(f"{verb} takes an object of names and values, not {values!r}")
    return values


class ControlPort:
    """The listening end, never blocking; several clients may be connected."""

    def __init__(self, answer: Callable[[str, Any], Any]) -> None:
        self._answer = answer
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.setblocking(False)
        self._clients: list[Channel] = []
        self.endpoint = f"127.0.0.1:{self._listener.getsockname()[1]}"

    def filenos(self) -> list[int]:
        """Descriptors to wait on."""
        return [self._listener.fileno(), *(client.fileno() for client in self._clients)]

    def receive(self) -> None:
        """Accepts who waits and answers what is complete."""
        with contextlib.suppress(OSError):
            self._clients.append(Channel(self._listener.accept()[0], [ControlRequest]))
        for client in list(self._clients):
            for received in client.receive_all():
                client.send(self._reply(received))
            client.flush()
            if client.lost:
                self._clients.remove(client)
                client.close()

    def _reply(self, received: Received) -> Message:
        request = received.message
        if not isinstance(request, ControlRequest):
            return Answer(to=received.id, refused="ask with a verb and an argument")
        try:
            value = to_jsonable_python(self._answer(request.verb, request.argument))
            return ControlReply(to=received.id, value=value)
        except RigError as error:
            return Answer(to=received.id, refused=str(error))
        except ValueError:  # a figure that is no number just now
            return Answer(to=received.id, refused=f"{request.verb} has no value that can be told now")
        except (Exception, SystemExit) as error:  # a plug-in's fault may raise anything, and the bench goes on
            return Answer(to=received.id, refused=f"{request.verb} failed, {type(error).__name__}: {error}")

    def close(self) -> None:
        """Hangs up on everybody."""
        for client in self._clients:
            client.close()
        self._clients.clear()
        self._listener.close()


class BenchControl:
    """A client of the control channel at ``address`` (host:port); a refusal raises UsageError in the bench's words."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        try:
            self._channel = Channel(socket.create_connection((host, int(port)), CLIENT_TIMEOUT_S), [ControlReply])
        except (OSError, ValueError) as error:
            raise DeviceError(f"{address}: no bench answers there ({error}); is `rig mock` running?") from error
        self._address = address

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: type[BaseException] | None, __: BaseException | None, ___: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Hangs up."""
        self._channel.close()

    def set(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Sets quantities; returns them as they are now."""
        return dict(self._ask("set", dict(values)))

    def get(self, *names: str) -> dict[str, Value]:
        """Quantities of the bench by name."""
        return dict(self._ask("get", list(names)))

    def number(self, name: str) -> float:
        """One quantity of the bench."""
        return float(self.get(name)[name])

    def fault(self, device: str, kind: str, value: Value | None = None) -> None:
        """Brings about a fault; ``faults`` lists them."""
        self._ask("fault", {"device": device, "kind": kind} | ({} if value is None else {"value": value}))

    def faults(self) -> dict[str, dict[str, str]]:
        """Meaning of each fault by device and kind."""
        return dict(self._ask("faults", True))

    def hide(self, effects: Mapping[str, float | None]) -> list[str]:
        """Switches on exactly these effects (``friction.level_N``: 0.2, or ``friction``: None); returns their names."""
        return list(self._ask("hide", dict(effects)))

    def truth(self) -> dict[str, dict[str, float]]:
        """Effects that are on, with all their parameters."""
        return dict(self._ask("truth", True))

    def synced_ns(self) -> list[int]:
        """When the drive took SYNCs, on this computer's monotonic clock, those not asked for before; 1000 at most."""
        return list(self._ask("synced_ns", True))

    def sampled(self, role: str) -> list[tuple[int, int]]:
        """When a force sensor took samples, by a mark that is in them, like ``synced_ns``.

        The mark is a SensONE's time stamp [us], and an FT 300's six counts of 16 bits as one number, the first lowest.
        """
        return [(mark, time_ns) for mark, time_ns in self._ask("sampled", role)]

    def _ask(self, verb: str, argument: Any) -> Any:
        if self._channel.lost:
            raise DeviceError(f"{self._address}: the bench hung up; it has ended")
        number = self._channel.send(ControlRequest(verb=verb, argument=argument))
        deadline = time.monotonic() + CLIENT_TIMEOUT_S
        while not self._channel.lost and (left_s := deadline - time.monotonic()) > 0:
            writing = [] if self._channel.flush() else [self._channel]
            select([self._channel], writing, [], left_s)
            for received in self._channel.receive_all():
                if isinstance(received.message, Reply) and received.message.to == number:
                    return _value(received.message)
        raise DeviceError(f"{self._address}: the bench hung up on {verb}, or does not answer; it has ended")


def _value(reply: Reply) -> Any:
    if isinstance(reply, ControlReply):
        return reply.value
    assert isinstance(reply, Answer)
    raise UsageError(reply.refused)
