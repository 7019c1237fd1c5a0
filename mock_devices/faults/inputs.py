"""What can go wrong with the inputs, and what is done to them, by name."""

from collections.abc import Mapping

from mock_devices.evdev.mock import SwitchMock
from mock_devices.faults.wires import FaultKind, Value, as_number, as_switch, switching
from mock_devices.firmata.mock import FirmataMock
from mock_devices.lsl.mock import BreathingMock
from rig.errors import UsageError

HEAVIEST_N, LONGEST_SHIFT_S = 50.0, 86_400.0


def _weight(glove: FirmataMock, value: Value) -> None:
    """``finger=newtons``; false takes all of them off."""
    glove.plant.weights_N = {} if value is False else dict([_on_finger(value)])


def _on_finger(value: Value) -> tuple[int, float]:
    finger, _, newtons = str(value).partition("=")
    try:
        return int(finger), as_number(float(newtons), 0.0, HEAVIEST_N)
    except ValueError as error:
        raise UsageError(f"this fault takes the number of a finger and newtons, as in 0=1.96, not {value!r}") from error


def _presses(glove: FirmataMock, value: Value) -> None:
    try:
        peaks_N = tuple(as_number(float(text), 0.0, HEAVIEST_N) for text in str(value).split(","))
    except ValueError as error:
        raise UsageError(f"this fault takes peaks in newtons, as in 8,8.4,7.9, not {value!r}") from error
    glove.plant.press(peaks_N, glove.time_s)


def _cut(glove: FirmataMock, value: Value) -> None:
    glove.plant.cut = set() if value is False else {round(as_number(value, 0, 5))}


def _foot(switch: SwitchMock, value: Value) -> None:
    switch.press(as_switch(value))


def _unplug(device: SwitchMock | BreathingMock, value: Value) -> None:
    (device.close if as_switch(value) else device.plug)()


def _shift(belt: BreathingMock, value: Value) -> None:
    belt.shift_s = as_number(value, -LONGEST_SHIFT_S, LONGEST_SHIFT_S)


GLOVE_FAULTS: Mapping[str, FaultKind[FirmataMock]] = {
    "silent": FaultKind("the board sends nothing", True, switching("silent")),
    "stuck": FaultKind("its converter repeats what it read", True, switching("stuck")),
    "weight": FaultKind("a weight on one finger, as finger=newtons; false: none", "0=1.96", _weight),
    "presses": FaultKind("somebody presses with the glove, peaks in newtons", "8.0,8.4,7.9", _presses),
    "cut": FaultKind("the wire of that finger is cut; false: whole", 0.0, _cut),
}
SWITCH_FAULTS: Mapping[str, FaultKind[SwitchMock]] = {
    "press": FaultKind("the key goes down; false: it comes up", True, _foot),
    "unplug": FaultKind("it is pulled out; false: it is put in again", True, _unplug),
}
BREATHING_FAULTS: Mapping[str, FaultKind[BreathingMock]] = {
    "silent": FaultKind("the belt sends nothing", True, switching("silent")),
    "unplug": FaultKind("its program ends; false: it is started again", True, _unplug),
    "shift": FaultKind("its clock is wrong by so many seconds", 0.25, _shift),
}
