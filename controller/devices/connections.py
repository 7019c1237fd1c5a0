"""The state of every device of the bench, and the way back of those that are lost."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from controller.devices import states
from controller.devices.health import NEVER_NS, ON_RATE, StreamHealth
from controller.devices.reopening import Openers, Reopening
from controller.devices.states import DeviceState, DeviceStatus, Observation
from controller.loop.modes import Mode
from drivers.roles import Device, Identity, ServoAxis

NO_TORQUE = "it takes no set-points after a stop: acknowledge that with a reset, or recover"
NO_REFERENCE = "it has no reference: it restarted, or was not homed; recovery homes it"
Said = Callable[[str, DeviceStatus], None]


def of_stream(health: StreamHealth, lost: str, now_ns: int, trouble: str = "") -> Observation:
    """What a sensor's stream shows, or the ``trouble`` that its driver has with it."""
    age_ns = health.age_ns(now_ns)
    imperfect = trouble
    if not health.valid:
        imperfect = "it marks its samples as invalid"
    elif not health.bits(now_ns) & ON_RATE:
        imperfect = f"{health.rate_Hz:.0f} Hz came instead of {1e9 / health.period_ns:.0f} Hz"
    return Observation(age_ns if age_ns < NEVER_NS // 2 else None, lost=lost, imperfect=imperfect)


def of_axis(health: StreamHealth, lost: str, axis: ServoAxis, now_ns: int) -> Observation:
    """What the axis shows; how often it answers is the loop's doing, so its rate says nothing about it."""
    seen = replace(of_stream(health, lost, now_ns), imperfect=axis.counters.trouble)
    if lost or seen.age_ns is None:
        return seen
    fault = axis.fault or ("" if axis.referenced else NO_REFERENCE)
    return replace(seen, fault=fault, withheld="" if axis.enabled else NO_TORQUE)


def _known(identity: Identity) -> Identity | None:
    """None for a device that never answered."""
    return identity if identity.product else None


class Connections:
    """Statuses by role; ``update`` is called a few times a second. ``said`` is told each change of state."""

    def __init__(self, devices: Mapping[str, Device], openers: Openers, said: Said, now_ns: int) -> None:
        self._said = said
        self.statuses = {role: states.connecting(now_ns) for role in devices}
        self._ways_back = {
            role: Reopening(openers.by_role[role], _known(device.identity), openers.spawn)
            for role, device in devices.items()
        }

    @property
    def ready(self) -> bool:
        """Whether every device is ok."""
        return all(status.state is DeviceState.OK for status in self.statuses.values())

    def shown_mode(self, mode: Mode) -> str:
        """The mode for people: idle only where every device is ok, else which are not."""
        if mode is not Mode.IDLE or self.ready:
            return mode.name.lower()
        bad = [f"{role} {status.state}" for role, status in self.statuses.items() if status.state is not DeviceState.OK]
        return f"not ready: {', '.join(bad)}"

    def refusal(self, needed: Iterable[str] | None = None) -> str:
        """Why nothing can start that needs those roles (all of them unless said), and the next step."""
        return states.refusal(self.statuses, self.statuses if needed is None else needed)

    def note(self, seen: Mapping[str, Observation], now_ns: int) -> None:
        """Takes down what is seen of each device."""
        for role, observation in seen.items():
            before = self.statuses[role]
            status = states.following(before, self._with_way_back(role, observation), now_ns)
            self.statuses[role] = status
            if status.state is not before.state:
                self._said(role, status)

    def _with_way_back(self, role: str, seen: Observation) -> Observation:
        way = self._ways_back[role]
        if way.stranger:
            return replace(seen, fault=way.stranger)
        return replace(seen, lost=way.error or seen.lost, reopening=way.active) if seen.lost else seen

    def under_way(self, role: str) -> bool:
        """Whether the driver there was is being replaced."""
        return self._ways_back[role].active

    def missing(self, seen: Mapping[str, Observation]) -> list[str]:
        """Roles whose link failed, or that have fallen silent."""
        return [role for role in seen if seen[role].lost or self.statuses[role].state is DeviceState.LOST]

    def reopen(self, role: str, old: Device, next_seq: int, at_rest: bool, now_ns: int) -> Device | None:
        """One look after a missing device; returns the driver that takes its place once that runs."""
        return self._ways_back[role].update(old, next_seq, at_rest, now_ns)

    def close(self) -> None:
        """Ends all attempts."""
        for way in self._ways_back.values():
            way.close()
