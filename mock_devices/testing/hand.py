"""A test's hand on a served mock bench: whichever products, faults and hidden effects by name, and `rig` on it."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from api.cli.mock_bench import mocks, plug_into
from api.cli.mock_calibration import force_file
from api.cli.mock_dynamics import dynamics_file
from api.cli.options import built_in
from mock_devices.control import BenchControl
from mock_devices.testing.commands import PATIENT, Said, ServedBench, rig, served_bench
from rig.config.products.roles import AxisProduct, ForceProduct, TrackerProduct
from rig.config.wiring import Wiring


class MockBench:
    """Every product that the bench can play. ``settings`` are those of `rig.toml`, as in ``force.product=...``."""

    def __init__(self, served: ServedBench) -> None:
        self.served = served

    @property
    def control(self) -> BenchControl:
        """Whatever else can be asked of the bench and set in it."""
        return self.served.control

    def fault(self, device: str, kind: str, value: bool | float | str | None = None) -> None:
        """Brings about a fault of a device; ``control.faults()`` lists them."""
        self.control.fault(device, kind, value)

    def hide(self, effects: Mapping[str, float | None]) -> None:
        """Hides exactly these effects in the bench, as ``{"friction.level_N": 0.2}``."""
        self.control.hide(effects)

    def load(self, load_N: float) -> None:
        """Puts a force on the tip, as a weight would."""
        self.control.set({"load.axial_N": load_N})

    def mend(self) -> None:
        """Plugs in, heals and uncovers everything."""
        self.load(0.0)
        self.hide({})
        for device, kinds in self.control.faults().items():
            for kind in kinds:
                if kind in ("unplug", "silent", "frozen", "invalid", "freeze", "wrong_identity"):
                    self.fault(device, kind, False)
            if "heal" in kinds:
                self.fault(device, "heal", True)

    def wiring(self, *settings: str) -> Wiring:
        """A wiring of products that this bench plays, each at its port, the force sensor and the axis calibrated."""
        return plug_into(built_in(list(settings)), self.served.endpoints)

    def settings(self, *settings: str) -> list[str]:
        """The same as options of a `rig` command, patient with a computer that others use too."""
        wiring = self.wiring(*settings)
        asked, endpoints = built_in(list(settings)), self.served.endpoints
        found = [f"calibration.force={force_file(asked, endpoints)}"]
        if wiring.calibration.of_dynamics:
            found.append(f"calibration.dynamics={dynamics_file(asked, endpoints)}")
        for role in mocks(asked):
            device = getattr(wiring, role)
            found.append(f"{role}.port={device.port}")
            if isinstance(device, AxisProduct):
                found.append(f"{role}.increments_per_mm={device.increments_per_mm}")
            if isinstance(device, ForceProduct | TrackerProduct):
                found.append(f"{role}.latency_ms={device.latency_ms}")
        return [part for setting in (*found, *PATIENT, *settings) for part in ("--set", setting)]

    def rig(self, *arguments: str | Path, folder: Path, settings: tuple[str, ...] = ()) -> Said:
        """Runs a `rig` command on this bench to its end."""
        return rig(*arguments, *self.settings(*settings), folder=folder)


@contextlib.contextmanager
def serving(links: Path, *options: str) -> Iterator[MockBench]:
    """A bench whose lines can be unplugged and plugged in again; they are found under ``links``."""
    with served_bench("--seed", "1", "--links", str(links), *options) as served:
        yield MockBench(served)
