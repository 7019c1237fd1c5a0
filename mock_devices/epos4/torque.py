"""Cyclic synchronous torque of the mock drive: from thousandths of the rated torque to a motor current and back."""

from collections.abc import Mapping

from mock_devices.cia402.table import Key

TARGET, OFFSET, RATED, CONSTANT, LARGEST_SPEED = (0x6071, 0), (0x60B2, 0), (0x6076, 0), (0x3001, 5), (0x6080, 0)


def current_A(values: Mapping[Key, int], speed: int) -> float:
    """Current for target and offset; none that would drive the motor beyond its largest speed (object 6080)."""
    wanted_A = (values[TARGET] + values[OFFSET]) / 1000 * values[RATED] / max(values[CONSTANT], 1)
    return 0.0 if wanted_A * speed > 0 and abs(speed) >= values[LARGEST_SPEED] else wanted_A


def per_mille(values: Mapping[Key, int], current_mA: int) -> int:
    """The torque of that current, in thousandths of the rated torque."""
    return round(current_mA * values[CONSTANT] / max(values[RATED], 1))
