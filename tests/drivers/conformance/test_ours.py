"""Our own products keep what the kit asks of everybody's."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from api.cli.mock_bench import at_endpoints
from api.cli.options import built_in
from controller.devices.drivers import open_axis, open_force, open_tracker
from controller.inputs.runner import open_input
from drivers.testing import CHECKS, UnderTest
from drivers.testing.under_test import nothing
from mock_devices.testing.hand import MockBench, serving
from rig.config.glove import FingerCalibration, GloveCalibration
from rig.config.products.firmata_glove import FirmataGlove
from rig.config.products.inputs import EVERY_ROLE
from rig.config.wiring import Wiring

pytestmark = [pytest.mark.campaign, pytest.mark.bench, pytest.mark.xdist_group("conformance")]

EACH = ("drop", "corrupt", "truncate", "garbage")
# A line of SLCAN has no checksum: against flipped bits there is only that of USB, which a pseudo-terminal lacks; and
# those of UDP and Firmata are that of the network, and none.
NO_CHECKSUM = ("drop", "truncate", "garbage")
# OpenIGTLink has no numbers: TCP loses nothing, and a frame that was not sent cannot be told from one that was lost.
NUMBERLESS = ("corrupt", "truncate", "garbage")
# Firmata has neither: of what is lost a pause alone tells, where two in a row are.
NO_NUMBERS = ("truncate", "garbage")


class Ours(NamedTuple):
    """A product, where its mock stands on the bench, and the damage that its protocol stands by itself."""

    role: str
    product: str
    mock: str
    damage: tuple[str, ...] = EACH


OURS = (
    Ours("force", "bota-sensone", "force"),
    Ours("force", "robotiq-ft300", "force_modbus"),
    Ours("force", "laumas-tlb", "force_gauge"),
    Ours("axis", "maxon-epos4", "axis", NO_CHECKSUM),
    Ours("axis", "cia402", "axis_cia402", NO_CHECKSUM),
    Ours("axis", "zaber-ascii", "axis_ascii"),
    Ours("tracker", "ndi-polaris", "tracker"),
    Ours("tracker", "optitrack-natnet", "tracker_natnet", NO_CHECKSUM),
    Ours("tracker", "openigtlink", "tracker_igtl", NUMBERLESS),
    Ours("input", "firmata-glove", "glove", NO_NUMBERS),
    Ours("input", "evdev-switch", "switch", ()),
    Ours("input", "lsl-stream", "breathing", ()),
)
INPUTS = [word for ours in OURS if ours.role == "input" for word in ("--input", ours.product)]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockBench]:
    with serving(tmp_path_factory.mktemp("links"), *INPUTS) as served:
        yield served


def table(ours: Ours) -> str:
    return "input.one" if ours.role == "input" else ours.role


def under_test(bench: MockBench, ours: Ours) -> UnderTest:
    wiring = at_endpoints(built_in([f"{table(ours)}.product={ours.product}"]), bench.served.endpoints)
    inputs = {name: calibrated(one) if isinstance(one, FirmataGlove) else one for name, one in wiring.input.items()}
    openers = {
        "force": lambda: open_force(wiring.force),
        "axis": lambda: open_axis(wiring.axis, wiring.limits, 1000.0),
        "tracker": lambda: open_tracker(wiring.tracker) if wiring.tracker else None,
        "input": lambda: open_input(inputs["one"]),
    }

    def press() -> None:
        for down in (True, False):
            bench.fault("switch", "press", down)

    return UnderTest(
        config_of(wiring, ours),
        openers[ours.role],  # type: ignore[arg-type] # one for each role
        lambda kind, value: bench.fault(ours.mock, kind, value),
        damage=ours.damage,
        load=bench.load if ours.role == "force" else None,
        act=press if ours.mock == "switch" else nothing,
    )


def config_of(wiring: Wiring, ours: Ours) -> Any:
    return wiring.input["one"] if ours.role == "input" else getattr(wiring, ours.role)


def calibrated(glove: Any) -> Any:
    """Without a calibration no force is known, and no sample of a glove valid."""
    finger = FingerCalibration(loads_N=(0.0, 5.0, 10.0), counts=(30.0, 300.0, 600.0), noise_counts=1, repeatability=0)
    fingers = dict.fromkeys(glove.fingers, finger)
    known = GloveCalibration(product=glove.product, firmware="", date=datetime.now(UTC), fingers=fingers)
    return glove.model_copy(update={"of_fingers": known})


def test_every_product_of_every_role_is_among_them() -> None:
    every = {(role, name) for role, products in EVERY_ROLE.items() for name in products}
    assert {(ours.role, ours.product) for ours in OURS} == every


@pytest.mark.parametrize("ours", OURS, ids=lambda ours: ours.product)
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_it_conforms(bench: MockBench, ours: Ours, check: Callable[[UnderTest], None], tmp_path: Path) -> None:
    try:
        check(under_test(bench, ours))
    finally:
        bench.mend()
