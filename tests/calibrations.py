"""Calibrations as `rig calibrate` would write them, for wirings of tests that start no bench of mocks."""

from datetime import UTC, datetime

from rig.config.calibration import AxisCalibration, AxisStep, ForceCalibration, Load, Uncertainty
from rig.config.force_map import CHANNELS, UNIT, ForceMap, Matrix, Vector
from rig.config.wiring import Wiring

LOADS_N = (0.0, 2.0, 5.0, 10.0, 5.0, 2.0, 0.0)
ZERO_N: Vector = (0.2, -0.1, 0.8)
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


def with_calibration(wiring: Wiring, product: str, serial: str) -> Wiring:
    """``wiring`` with a calibration that agrees with it, of the sensor of that serial number; its own is kept."""
    if wiring.calibration.of_force:
        return wiring
    known = force_calibration(product, serial, ForceMap(wiring.force.axis, wiring.force.compression))
    return wiring.model_copy(update={"calibration": wiring.calibration.model_copy(update={"of_force": known})})


def _shown_N(load_N: float, known: ForceMap) -> Vector:
    shown = list(ZERO_N)
    shown[CHANNELS.index(known.channel)] += known.sign * load_N
    x, y, z = shown
    return x, y, z
