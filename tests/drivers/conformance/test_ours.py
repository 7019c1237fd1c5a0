"""Our own products keep what the kit asks of everybody's."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from controller.devices.drivers import open_axis, open_force, open_tracker
from drivers.testing import CHECKS, UnderTest
from mock_devices.testing.hand import MockBench, serving

pytestmark = [pytest.mark.campaign, pytest.mark.bench, pytest.mark.xdist_group("conformance")]


EACH = ("drop", "corrupt", "truncate", "garbage")
# A line of SLCAN has no checksum: against flipped bits there is only that of USB, which a pseudo-terminal lacks.
OF_USB = ("drop", "truncate", "garbage")


class Ours(NamedTuple):
    """A product, where its mock stands on the bench, and the damage that its protocol stands by itself."""

    role: str
    product: str
    mock: str
    damage: tuple[str, ...] = EACH


OURS = (
    Ours("force", "bota-sensone", "force"),
    Ours("force", "robotiq-ft300", "force_modbus"),
    Ours("axis", "maxon-epos4", "axis", OF_USB),
    Ours("tracker", "ndi-polaris", "tracker"),
)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockBench]:
    with serving(tmp_path_factory.mktemp("links")) as served:
        yield served


def under_test(bench: MockBench, ours: Ours) -> UnderTest:
    wiring = bench.wiring(f"{ours.role}.product={ours.product}")
    openers = {
        "force": lambda: open_force(wiring.force),
        "axis": lambda: open_axis(wiring.axis, wiring.limits, 1000.0),
        "tracker": lambda: open_tracker(wiring.tracker) if wiring.tracker else None,
    }
    return UnderTest(
        getattr(wiring, ours.role),
        openers[ours.role],  # type: ignore[arg-type] # one for each role
        lambda kind, value: bench.fault(ours.mock, kind, value),
        damage=ours.damage,
        load=bench.load if ours.role == "force" else None,
    )


@pytest.mark.parametrize("ours", OURS, ids=lambda ours: ours.product)
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_it_conforms(bench: MockBench, ours: Ours, check: Callable[[UnderTest], None], tmp_path: Path) -> None:
    try:
        check(under_test(bench, ours))
    finally:
        bench.mend()
