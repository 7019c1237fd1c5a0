"""A bench that does not start gives back what it had opened."""

import pytest

from controller.devices import absent, drivers
from controller.devices.absent import start_what_answers
from controller.devices.drivers import start_devices
from rig.config.wiring import Wiring
from rig.errors import DeviceError


class Opened:
    """Says in ``said`` what is done with it; the one called ``broken`` does not start."""

    def __init__(self, name: str, broken: str, said: list[str]) -> None:
        self._name, self._broken, self._said = name, broken, said

    def start(self) -> None:
        self._said.append(f"start {self._name}")
        if self._name == self._broken:
            raise DeviceError(f"{self._name} does not answer")

    def close(self) -> None:
        self._said.append(f"close {self._name}")


def said_by(monkeypatch: pytest.MonkeyPatch, broken: str) -> list[str]:
    said: list[str] = []
    for module in (drivers, absent):
        for name in ("force", "axis", "tracker"):
            monkeypatch.setattr(module, f"open_{name}", lambda *_, name=name: Opened(name, broken, said))
    return said


@pytest.mark.parametrize(
    ("broken", "closed"),
    [("force", ["force"]), ("axis", ["axis", "force"]), ("tracker", ["tracker", "axis", "force"])],
)
def test_where_one_does_not_start_all_that_were_opened_are_closed_the_last_first(
    broken: str, closed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = said_by(monkeypatch, broken)
    with pytest.raises(DeviceError, match=f"{broken} does not answer"):
        start_devices(Wiring())
    assert [word for word in said if "close" in word] == [f"close {name}" for name in closed]
    assert said[-len(closed) - 1] == f"start {broken}"


def test_where_all_start_none_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    said = said_by(monkeypatch, "")
    start_devices(Wiring())
    assert said == ["start force", "start axis", "start tracker"]


@pytest.mark.parametrize(("broken", "closed"), [("tracker", ["close tracker"]), ("force", ["close force"]), ("", [])])
def test_a_recovery_begins_without_a_sensor_that_does_not_start(
    broken: str, closed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    said = said_by(monkeypatch, broken)
    found = start_what_answers(Wiring())
    assert [word for word in said if "close" in word] == closed
    if broken:
        with pytest.raises(DeviceError, match=f"{broken} does not answer"):
            vars(found)[broken].poll(0)


def test_a_recovery_closes_an_axis_that_does_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    said = said_by(monkeypatch, "axis")
    with pytest.raises(DeviceError, match="axis does not answer"):
        start_what_answers(Wiring())
    assert said == ["start axis", "close axis"]
