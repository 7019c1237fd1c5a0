"""What a simulation says of the loop beside the run itself: margins at each force, the worst of them, and its reach."""

from pathlib import Path

import numpy as np
import pytest

from api.operations.simulate import SimulatedRun, play, simulate
from controller.experiments.references import parse_reference
from controller.loop.modes import Mode
from controller.operation import Operation
from mock_devices.testing.models import index_model
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.results.tables import simulation_parts
from rig.results.tracking import SimulateResult

MODEL = index_model(0.12, 0.22, 0.01, force_N=6.0)
STEP = parse_reference("step:2,duration_s=1")


def simulated(out: Path, stiffness: float = 1.0) -> SimulateResult:
    return simulate(Operation("simulate"), Wiring(), SimulatedRun(STEP, MODEL, stiffness), out)


def test_margins_and_reach_are_said_and_drawn(tmp_path: Path) -> None:
    found, stiff = simulated(tmp_path / "one"), simulated(tmp_path / "two", 2.0)
    assert [row.force_N for row in found.margins] == pytest.approx([0.5, 1.0, 2.0, 5.0], abs=0.25)
    for row, stiffer in zip(found.margins, stiff.margins, strict=True):
        assert 45 < row.worst_phase_deg <= stiffer.phase_deg < row.phase_deg
        assert 2 < row.worst_gain <= stiffer.gain < row.gain
        assert stiffer.tangent_N_mm == pytest.approx(2 * row.tangent_N_mm)
        assert row.stiffest_N_mm == stiffer.stiffest_N_mm > stiffer.tangent_N_mm
    assert 0 < found.reach.left_of_motion < 0.05
    assert found.reach.noise_share < 0.5
    assert {file.name for file in (tmp_path / "one").iterdir()} == {
        "simulation.svg", "simulation.png", "bode.svg", "nyquist.svg"
    }  # fmt: skip
    sentence = next(part for part in simulation_parts(found) if isinstance(part, str))
    assert f"crossover {found.reach.crossover_Hz:.1f} Hz, two leads" in sentence


def test_tissue_that_no_law_holds_is_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    undamped = index_model(0.12, 0.22, 0.0, force_N=6.0)
    with pytest.raises(UsageError, match="damping is 0 N s/mm"):
        simulate(Operation("simulate"), Wiring(), SimulatedRun(STEP, undamped), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_is_played_hears_the_sensor_as_seldom_as_the_configured_one() -> None:
    """Of 100 Hz: where every cycle had a sample, the law would act ten times as often as on the bench."""
    for product, every_ms in (("bota-sensone", 1), ("robotiq-ft300", 10)):
        wiring = Wiring.model_validate({"force": {"product": product}})
        trace = play(Operation("simulate"), wiring, SimulatedRun(STEP, MODEL)).trace
        changed = np.flatnonzero(np.diff(trace.sensed_N[trace.mode == Mode.CONTACT]))
        assert np.min(np.diff(changed)) == every_ms
