"""Who may approach: only with a calibration of the sensor that answers, which the wiring does not contradict."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from controller.commissioning.refusals import refuse_uncalibrated, refuse_uncommissioned
from controller.law.inverse_model import GainRow
from controller.loop.steps import Approach, Program, Retract, TrackForce, Zero
from drivers.roles import Identity
from rig.config.axis_dynamics import AxisDynamics
from rig.config.calibration import AxisCalibration, Calibration, ForceCalibration, Uncertainty
from rig.config.force_map import ForceMap
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.cia402 import Cia402Wiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Wiring
from rig.errors import UsageError
from tests.calibrations import axis_calibration, axis_dynamics, force_calibration
from tests.controller.fake_bench import FakeBench, wired

NOW = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)
SENSOR, DRIVE = Identity("BFT-SENS-SER-M8", "000271", "1.0.6"), Identity("EPOS4", "A1", "0x0170")
ZERO, APPROACH = Zero(duration_s=0.2), Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0)
PRESSES = Program(name="press", steps=(ZERO, APPROACH))
GAINS = tuple(GainRow(force_N=at, depth_mm=at, tangent_N_mm=1.0, damping_N_s_mm=0.01) for at in (0.0, 5.0))
LAW = TrackForce(times_s=(0.0, 1.0), forces_N=(1.0, 1.0), gains=GAINS, crossover_rad_s=60.0)
TRACKS = Program(name="track", steps=(ZERO, APPROACH, LAW))
LEAVES = Program(name="leave", steps=(Retract(clearance_mm=5.0, speed_mm_s=10.0),))
OF_FORCE = force_calibration(date=NOW)
OF_AXIS = axis_calibration(date=NOW)


def wiring(
    of_force: ForceCalibration | None = OF_FORCE, of_axis: AxisCalibration | None = None, **tables: object
) -> Wiring:
    tables = {"force": BotaWiring(port="/dev/ttyUSB0")} | tables
    return Wiring.model_validate({"calibration": Calibration(of_force=of_force, of_axis=of_axis), **tables})


def refused(found: Wiring, program: Program = PRESSES, sensor: Identity = SENSOR, axis: Identity = DRIVE) -> None:
    refuse_uncommissioned(program, found, sensor, axis, NOW)


def test_with_its_own_calibrations_a_bench_may_approach() -> None:
    refused(wiring(of_axis=OF_AXIS))
    refuse_uncalibrated(wiring(of_axis=OF_AXIS), NOW)


def test_without_one_a_program_that_only_leaves_is_run() -> None:
    refused(wiring(of_force=None), LEAVES)
    with pytest.raises(UsageError, match="press refused before moving: no force calibration of BFT-SENS-SER-M8 000271"):
        refused(wiring(of_force=None))


def test_a_real_sensor_without_one_is_refused_before_anything_is_opened_and_a_mock_one_is_not() -> None:
    with pytest.raises(
        UsageError, match="no force calibration of the sensor at /dev/ttyUSB0: run `rig calibrate force`"
    ):
        refuse_uncalibrated(wiring(of_force=None), NOW)
    refuse_uncalibrated(Wiring(), NOW)


@pytest.mark.parametrize(
    ("sensor", "sentence"),
    [
        (Identity(SENSOR.product, "000272", ""), "of BFT-SENS-SER-M8 000271, but BFT-SENS-SER-M8 000272 answered"),
        (Identity("robotiq-ft300", "000271", ""), "but robotiq-ft300 000271 answered"),
    ],
)
def test_the_calibration_of_another_sensor_is_refused(sensor: Identity, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        refused(wiring(), sensor=sensor)


def test_the_calibration_of_another_axis_is_refused() -> None:
    with pytest.raises(UsageError, match=r"calibration.axis is of EPOS4 A1, but EPOS4 A2 answered"):
        refused(wiring(of_axis=OF_AXIS), axis=Identity("EPOS4", "A2", ""))


@pytest.mark.parametrize(
    ("age", "sentence"),
    [
        (timedelta(days=366), "is 366 days old, calibration.max_age_days is 365: run `rig calibrate force`"),
        (timedelta(minutes=-2), "which is still to come: check the clocks"),
    ],
)
def test_a_calibration_too_old_or_of_tomorrow_is_refused(age: timedelta, sentence: str) -> None:
    found = wiring(force_calibration(date=NOW - age))
    with pytest.raises(UsageError, match=sentence):
        refused(found)
    with pytest.raises(UsageError, match=sentence):
        refuse_uncalibrated(found, NOW)


def test_the_oldest_allowed_is_taken() -> None:
    refused(wiring(force_calibration(date=NOW - timedelta(days=365))))


def test_one_less_certain_than_stated_is_refused() -> None:
    unsure = Uncertainty(combined=0.021, repeatability=0.02, weights=0.004, linearity=0.002)
    with pytest.raises(UsageError, match=r"is uncertain by 2.1 %, calibration.max_uncertainty is 2 %"):
        refused(wiring(force_calibration(date=NOW, uncertainty=unsure)))


@pytest.mark.parametrize(
    ("force", "sentence"),
    [
        ({"compression": "positive"}, "force.compression positive: the calibration found compression negative on fz"),
        ({"axis": "fx"}, "force.axis fx, force.compression negative: the calibration found compression negative on fz"),
    ],
)
def test_a_wiring_that_contradicts_the_force_calibration_is_refused(force: dict[str, str], sentence: str) -> None:
    found = wiring(force=BotaWiring.model_validate({"port": "/dev/ttyUSB0", **force}))
    with pytest.raises(UsageError, match=sentence):
        refused(found)
    with pytest.raises(UsageError, match=sentence):
        refuse_uncalibrated(found, NOW)


@pytest.mark.parametrize("axis", [Epos4Wiring(increments_per_mm=4000.0), Epos4Wiring(direction=-1)])
def test_a_wiring_that_contradicts_the_axis_calibration_is_refused(axis: Epos4Wiring) -> None:
    with pytest.raises(UsageError, match=r"the axis was calibrated with 2000 and 1"):
        refused(wiring(of_axis=OF_AXIS, axis=axis))


@pytest.mark.parametrize(
    ("dynamics", "sentence"),
    [
        (None, "track refused before moving: no dynamics of EPOS4 A1: run `rig calibrate axis --dynamics`"),
        (axis_dynamics(date=NOW, serial="A2"), "calibration.dynamics is of EPOS4 A2, but EPOS4 A1 answered"),
        (axis_dynamics(date=NOW).model_copy(update={"computer": "lab-7-0badcafe"}), "identified on lab-7-0badcafe"),
    ],
)
def test_no_force_loop_runs_on_an_axis_that_was_not_identified_here(
    dynamics: AxisDynamics | None, sentence: str
) -> None:
    known = wiring().calibration.model_copy(update={"of_dynamics": dynamics})
    found = wiring().model_copy(update={"calibration": known})
    with pytest.raises(UsageError, match=sentence):
        refused(found, TRACKS)
    refused(found)  # a capture closes no force loop


def test_a_force_loop_runs_on_an_axis_that_was_identified_here() -> None:
    known = wiring().calibration.model_copy(update={"of_dynamics": axis_dynamics(date=NOW)})
    refused(wiring().model_copy(update={"calibration": known}), TRACKS)


def test_a_scale_that_the_drive_says_is_held_against_the_calibration_once_it_has_answered() -> None:
    """The calibration is of an axis of 2000 to the millimetre."""
    found = wiring(of_axis=OF_AXIS, axis=Cia402Wiring(port="/dev/ttyACM0"))
    refuse_uncalibrated(found, NOW)
    refused(found, axis=replace(DRIVE, settings={"increments_per_mm": "2000.0"}))
    with pytest.raises(UsageError, match=r"axis.increments_per_mm 1000, .* the axis was calibrated with 2000 and 1"):
        refused(found, axis=replace(DRIVE, settings={"increments_per_mm": "1000.0"}))
    with pytest.raises(UsageError, match=r"axis.direction -1: the axis was calibrated with 2000 and 1"):
        refuse_uncalibrated(wiring(of_axis=OF_AXIS, axis=Cia402Wiring(port="/dev/ttyACM0", direction=-1)), NOW)


def test_the_loop_itself_refuses_and_stays_idle() -> None:
    bench = FakeBench(wired(calibration={"of_force": force_calibration("FakeForce", "2")}))
    bench.begin(ZERO, APPROACH)
    assert any("FakeForce 1 answered" in answer["refused"] for answer in bench.link.of("answer"))
    assert not bench.loop.machine.busy


def test_the_loop_reads_compression_through_the_matrix() -> None:
    matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.04))
    known = force_calibration("FakeForce", "1", ForceMap("fz", "negative"), matrix=matrix)
    plain, scaled = FakeBench(), FakeBench(wired(calibration={"of_force": known}))
    assert plain.loop.state.raw_N != 0
    assert scaled.loop.state.raw_N == pytest.approx(1.04 * plain.loop.state.raw_N)
    assert scaled.loop.state.wrench[2] == pytest.approx(1.04 * plain.loop.state.wrench[2])
    assert scaled.loop.state.wrench[3:] == plain.loop.state.wrench[3:]
