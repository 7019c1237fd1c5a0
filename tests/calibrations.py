"""Calibrations as `rig calibrate` would write them, for wirings of tests that start no bench of mocks."""

from datetime import UTC, datetime

from rig.computer import computer_id
from rig.config.axis_dynamics import AxisDynamics, Reversal, TimeEstimate
from rig.config.calibration import AxisCalibration, AxisStep, ForceCalibration, Load, Uncertainty
from rig.config.force_map import CHANNELS, UNIT, ForceMap, Matrix, Vector
from rig.config.wiring import Wiring

LOADS_N = (0.0, 2.0, 5.0, 10.0, 5.0, 2.0, 0.0)
ZERO_N: Vector = (0.2, -0.1, 0.8)
DELAY = TimeEstimate(s=0.0005, within_s=0.0004)
SURE = Uncertainty(combined=0.005, repeatability=0.001, weights=0.004, linearity=0.002)


def force_calibration(
    product: str = "BFT-SENS-SER-M8",
    serial: str = "000271",
    known: ForceMap | None = None,
    date: datetime | None = None,
    matrix: Matrix = UNIT,
    uncertainty: Uncertainty = SURE,
) -> ForceCalibration:
    """Of a sensor whose channels show its loads exactly, made now where no date is given."""
    known = known or ForceMap()
    return ForceCalibration(
        product=product,
        serial=serial,
        date=date or datetime.now(UTC),
        channel=known.channel,
        compression=known.compression,
        matrix=matrix,
        zero_N=ZERO_N,
        zero_N_m=(0.0, 0.0, 0.0),
        noise_N=(0.005, 0.005, 0.005),
        noise_N_m=(0.0002, 0.0002, 0.0002),
        loads=tuple(
            Load(load_N=load_N, force_N=_shown_N(load_N, known), torque_N_m=(0.0, 0.0, 0.0)) for load_N in LOADS_N
        ),
        uncertainty=uncertainty,
    )


def axis_calibration(serial: str = "A1", date: datetime | None = None) -> AxisCalibration:
    """Of an axis whose millimetres are those of the tracker but for a thousandth."""
    return AxisCalibration(
        product="EPOS4",
        serial=serial,
        date=date or datetime.now(UTC),
        scale=1.001,
        uncertainty=0.002,
        direction=1,
        direction_known_by="limb marker",
        increments_per_mm=2000.0,
        reference="tracker",
        steps=(AxisStep(axis_mm=0.0, reference_mm=0.0), AxisStep(axis_mm=10.0, reference_mm=10.01)),
    )


def axis_dynamics(
    wiring: Wiring | None = None,
    product: str = "EPOS4",
    serial: str = "A1",
    date: datetime | None = None,
    delay: TimeEstimate = DELAY,
) -> AxisDynamics:
    """Of an axis with two lags of about 3 ms, as this computer would find it, beside a sensor of 1 kHz."""
    wiring = wiring or Wiring()
    return AxisDynamics(
        product=product,
        serial=serial,
        date=date or datetime.now(UTC),
        computer=computer_id(),
        rate_Hz=wiring.loop.rate_Hz,
        force_product=wiring.force.product,
        gain=1.0,
        delay=delay,
        total=TimeEstimate(s=delay.s + 0.0062, within_s=0.0001),
        reversal=Reversal(lost_mm=0.001, lost_within_mm=0.0005, friction_A=0.07, friction_within_A=0.01),
        lowest_Hz=2.0,
        highest_Hz=102.0,
        coherence=0.97,
        misfit=0.02,
        force_filter_s=0.5 / wiring.force.sampled_Hz,
        force_age_s=0.5 / wiring.force.sampled_Hz,
        lag1=TimeEstimate(s=0.0025, within_s=0.001),
        lag2=TimeEstimate(s=0.0037, within_s=0.001),
    )


def with_calibration(wiring: Wiring, product: str, serial: str, drive: str = "FakeAxis") -> Wiring:
    """``wiring`` with calibrations that agree with it, of the sensor of that serial number and of ``drive``.

    Its own are kept.
    """
    known = wiring.calibration
    force = force_calibration(product, serial, ForceMap(wiring.force.axis, wiring.force.compression))
    found = {"of_force": known.of_force or force}
    dynamics = {"of_dynamics": known.of_dynamics or axis_dynamics(wiring, drive, "1")}
    return wiring.model_copy(update={"calibration": known.model_copy(update=found | dynamics)})


def _shown_N(load_N: float, known: ForceMap) -> Vector:
    shown = list(ZERO_N)
    shown[CHANNELS.index(known.channel)] += known.sign * load_N
    x, y, z = shown
    return x, y, z
