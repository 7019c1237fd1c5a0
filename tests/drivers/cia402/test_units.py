"""Scale of a drive by what it says of itself: closed forms of CiA 402-2's factors and of CiA 303-2's units."""

from typing import Any, cast

import pytest

from drivers.cia402.units import position_scale, speed_unit
from drivers.epos4.node import Node
from drivers.epos4.objects import Entry
from rig.config.products.cia402 import Cia402Wiring
from rig.errors import DeviceError

# As canopen-stack's CiA 402 profile (heig-vd-iai) writes millimetres and millimetres a second.
MILLIMETRES, MILLIMETRES_A_SECOND = 4_244_701_184, 4_244_701_952
MICROMETRES, NANOMETRES, METRES, INCREMENTS = 0xFA01_0000, 0xF701_0000, 0x0001_0000, 0x00B5_0000
RPM, TENTHS_OF_RPM = 0x00B4_4700, 0xFFB4_4700
NOBODY = "nothing says how many of its position units are a millimetre: give axis.increments_per_mm"


class Said:
    """A node that has these objects, and answers for them."""

    name = "drive"

    def __init__(self, **objects: int) -> None:
        self._values = {tuple(int(part, 16) for part in name[1:].split("_")): value for name, value in objects.items()}

    def read(self, entry: Entry) -> int:
        return self._values[entry.index, entry.sub]

    def has(self, entry: Entry) -> bool:
        return (entry.index, entry.sub) in self._values


def feed(units: int, turns: int = 1) -> dict[str, int]:
    return {"x6092_1": units, "x6092_2": turns}


def encoder(increments: int, gear: tuple[int, int] | None = (1, 1)) -> dict[str, int]:
    geared = {"x6091_1": gear[0], "x6091_2": gear[1]} if gear else {}
    return {"x608F_1": increments, "x608F_2": 1, **geared}


def scale(objects: dict[str, int], **config: Any) -> float:
    said = Said(**objects)
    return position_scale(cast(Node, said), Cia402Wiring(**config), said.has).per_mm


@pytest.mark.parametrize(
    ("objects", "lead_mm", "per_mm"),
    [
        (feed(5000), 5.0, 1000.0),
        (feed(20_000, 2), 4.0, 2500.0),
        (encoder(16_384), 5.0, 3276.8),
        (encoder(4096, (7, 2)), 2.0, 7168.0),
        (feed(5000) | {"x60A8_0": MICROMETRES}, 0.0, 1e3),
        (feed(5_000_000) | {"x60A8_0": NANOMETRES}, 5.0, 1e6),
        (feed(5000) | {"x60A8_0": INCREMENTS}, 5.0, 1000.0),
        # A unit of a millimetre is the default of a profile, and no drive of a force bench counts in it.
        (feed(5000) | {"x60A8_0": MILLIMETRES}, 5.0, 1000.0),
    ],
)
def test_a_scale_that_is_not_stated_is_the_drives_own(objects: dict[str, int], lead_mm: float, per_mm: float) -> None:
    assert scale(objects, lead_mm=lead_mm) == pytest.approx(per_mm)


@pytest.mark.parametrize("lead_mm", [0.0, 0.5, 5.0])
@pytest.mark.parametrize(
    "objects",
    [
        {},
        feed(1),
        feed(0),
        feed(300, 300),
        encoder(1),
        encoder(16_384, gear=None),
        {"x60A8_0": MICROMETRES},
        feed(1) | {"x60A8_0": MICROMETRES},
        encoder(1) | {"x60A8_0": MICROMETRES},
    ],
)
def test_factors_that_nobody_set_up_give_no_scale(objects: dict[str, int], lead_mm: float) -> None:
    with pytest.raises(DeviceError, match=NOBODY):
        scale(objects, lead_mm=lead_mm)


@pytest.mark.parametrize("objects", [feed(5000), feed(5000) | {"x60A8_0": METRES}, encoder(16_384)])
def test_units_of_unknown_length_need_the_lead(objects: dict[str, int]) -> None:
    with pytest.raises(DeviceError, match=f"{NOBODY}, or axis.lead_mm where the drive's factors"):
        scale(objects)


@pytest.mark.parametrize(
    ("config", "sentence"),
    [
        ({"lead_mm": 2.5}, r"unit of position \(object 60A8\) that is 1000 a mm, where .* axis.lead_mm 2.5 says 2000;"),
        ({"increments_per_mm": 2000.0, "lead_mm": 2.5}, r"unit .* \(object 60A8\) that is 1000 a mm, .* says 2000;"),
        ({"increments_per_mm": 2000.0, "lead_mm": 5.0}, r"that is 1000 a mm, where axis.increments_per_mm says 2000;"),
    ],
)
def test_two_that_say_different_scales_are_refused(config: dict[str, float], sentence: str) -> None:
    with pytest.raises(DeviceError, match=sentence):
        scale(feed(5000) | {"x60A8_0": MICROMETRES}, **config)


def unit(objects: dict[str, int], per_mm: float = 1000.0, **config: Any) -> float:
    said = Said(**objects)
    return speed_unit(cast(Node, said), Cia402Wiring(**config), said.has, per_mm)


@pytest.mark.parametrize(
    ("objects", "per_second"),
    [
        ({}, 1.0),
        ({"x60A9_0": MILLIMETRES_A_SECOND}, 1000.0),
        (feed(6000) | {"x60A9_0": RPM}, 100.0),
        (encoder(6000) | {"x60A9_0": TENTHS_OF_RPM}, 10.0),
    ],
)
def test_the_unit_of_speed_is_in_units_of_position_a_second(objects: dict[str, int], per_second: float) -> None:
    assert unit(objects) == pytest.approx(per_second)


@pytest.mark.parametrize("objects", [{}, feed(1), encoder(6000, gear=None), encoder(6000, gear=(3, 1))])
@pytest.mark.parametrize("asked", ["auto", "rpm"])
def test_turns_of_unknown_size_make_no_speed(objects: dict[str, int], asked: str) -> None:
    objects = objects | {"x60A9_0": RPM}
    with pytest.raises(DeviceError, match=r"its speeds are in rpm, and nothing says .* give axis.increments_per_rev"):
        unit(objects, speed_unit=asked)
    assert unit(objects, speed_unit=asked, increments_per_rev=6000.0) == 100.0
