"""What can go wrong inside force sensor and camera before any protocol: each sets one figure of their physics."""

from collections.abc import Mapping

from mock_devices.faults.wires import FaultKind, Value, as_number, as_switch
from mock_devices.physics.camera import CameraPlant
from mock_devices.physics.channels import CHANNELS, Slips
from mock_devices.physics.sensor import ForcePlant

# Beyond any fault of a bench, more than ten times the default of each: a larger number is a slip of the unit.
GAIN_LARGEST, DRIFT_LARGEST_N_S = 10.0, 100.0
SLIP_LARGEST_MM, LEVER_LARGEST_MM = 200.0, 1000.0


def _polarity(plant: ForcePlant, value: Value) -> None:
    plant.channels.gain = -1.0 if as_switch(value) else 1.0


def _gain(plant: ForcePlant, value: Value) -> None:
    plant.channels.gain = as_number(value, 0, GAIN_LARGEST)


def _dead(plant: ForcePlant, value: Value) -> None:
    plant.channels.dead = None if value is False else round(as_number(value, 0, CHANNELS - 1))


def _crossed(plant: ForcePlant, value: Value) -> None:
    plant.channels.crossed = as_switch(value)


def _drift(plant: ForcePlant, value: Value) -> None:
    plant.channels.drift(as_number(value, -DRIFT_LARGEST_N_S, DRIFT_LARGEST_N_S), plant.time_s)


def _saturate(plant: ForcePlant, value: Value) -> None:
    plant.channels.end_N = as_number(value, 0.01, 1e6)


def _lever(plant: ForcePlant, value: Value) -> None:
    plant.lean(as_number(value, -LEVER_LARGEST_MM, LEVER_LARGEST_MM))


def _tip_slips(camera: CameraPlant, value: Value) -> None:
    camera.slips.tip_mm = (_slip(value), 0.0, 0.0)


def _arm_slips(camera: CameraPlant, value: Value) -> None:
    camera.slips.arm_mm = (_slip(value), 0.0, 0.0)


def _pushed(camera: CameraPlant, value: Value) -> None:
    by_mm = (_slip(value), 0.0, 0.0)
    camera.slips = Slips(by_mm, by_mm)


def _slip(value: Value) -> float:
    return as_number(value, -SLIP_LARGEST_MM, SLIP_LARGEST_MM)


SENSOR_FAULTS: Mapping[str, FaultKind[ForcePlant]] = {
    "polarity": FaultKind("all channels have the other sign, as with the supply's wires exchanged", True, _polarity),
    "gain": FaultKind("all channels answer a load with this many times what is true", 0.5, _gain),
    "dead": FaultKind("the channel of this index answers no load (0 to 5: Fx Fy Fz Mx My Mz); false: none", 2, _dead),
    "crossed": FaultKind("Fx Fy Fz come out one place further: Fz as Fx, Fx as Fy, Fy as Fz", True, _crossed),
    "drift": FaultKind("the zero runs away from now on, N/s of compression shown; 0: it is back", 0.5, _drift),
    "lever": FaultKind("the load acts this many mm beside the sensor's axis", 50.0, _lever),
    "saturate": FaultKind(
        "all force channels end at this many newtons, and flag it where the product can", 2.0, _saturate
    ),
}
CAMERA_FAULTS: Mapping[str, FaultKind[CameraPlant]] = {
    "tip_slips": FaultKind("the marker on the tip slips by this many mm across the axis", 5.0, _tip_slips),
    "arm_slips": FaultKind("the marker on the limb slips by this many mm across the axis", 15.0, _arm_slips),
    "pushed": FaultKind("the camera is pushed: both markers are seen this many mm aside", 15.0, _pushed),
}
