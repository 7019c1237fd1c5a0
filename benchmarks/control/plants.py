"""Axes, sensors and limbs that laws are compared on, and each axis' response as the product's own command finds it."""

from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.control.motion import FAR_MM, Bench, Column, Contact, moved_compiled
from controller.commissioning.axis_dynamics import SweepRecord, identify
from controller.commissioning.sweep import offset_mm, sweep_for
from drivers.roles import Identity
from mock_devices.parameters import load_parameters
from mock_devices.testing.models import index_model
from rig.config.axis_dynamics import AxisDynamics
from rig.config.wiring import Wiring
from rig.simulation.axis_plant import ForceSensing, ModelledLimb, Motor, PositionLoop, at_rest
from rig.tissue.model import Model

SUBJECTS = ("average", "firm", "lean", "soft", "tense")
FOLDER = Path(__file__).parents[2] / "mock_devices" / "subjects"
CURVE_POINTS, BEYOND = 600, 2.5
MODELLED_N = 11.0
BANDWIDTH_HZ, SMOOTHING_S = 34.0, 0.003  # of the axis as it is; others are as many times as fast
COUNT_MM = 0.0005
FAST = ForceSensing()
# The Robotiq FT 300 as the mock bench has it.
SLOW = ForceSensing(filter_s=0.003, noise_N=0.05, quantum_N=0.01, delay_cycles=1, every_cycles=10)


class Plant(NamedTuple):
    """An axis by its bandwidth, a sensor, and how many cycles of delay there are more."""

    bandwidth_Hz: float = BANDWIDTH_HZ
    sensing: ForceSensing = FAST
    extra_cycles: int = 0

    @property
    def loop(self) -> PositionLoop:
        """The drive's position loop, with set-point filters as fast as the bandwidth says."""
        return PositionLoop(smoothing_s=SMOOTHING_S * BANDWIDTH_HZ / self.bandwidth_Hz)

    @property
    def late_sensing(self) -> ForceSensing:
        """The sensor with the extra delay."""
        return self.sensing._replace(delay_cycles=self.sensing.delay_cycles + self.extra_cycles)

    def bench(self, limb: ModelledLimb, surface_mm: Column, contact: Contact = Contact()) -> Bench:  # noqa: B008
        """With a limb on it."""
        return Bench(Motor(), self.loop, self.late_sensing, limb, contact, surface_mm)


PLANT = Plant()


@lru_cache
def wiring_of(plant: Plant = PLANT) -> Wiring:
    """The wiring of this plant with its dynamics identified."""
    slow = plant.sensing.every_cycles > 1
    wiring = Wiring.model_validate({
        "axis": {"bandwidth_Hz": plant.bandwidth_Hz},
        "force": {"product": "robotiq-ft300" if slow else "bota-sensone"},
    })  # fmt: skip
    known = wiring.calibration.model_copy(update={"of_dynamics": dynamics_of(plant, wiring)})
    return wiring.model_copy(update={"calibration": known})


def dynamics_of(plant: Plant, wiring: Wiring) -> AxisDynamics:
    """Swept in the air and identified by the functions of `rig calibrate axis --dynamics`."""
    sweep, period_s = sweep_for(wiring, 1.0, 6, 2), 0.001
    told_s = np.arange(0.0, sweep.duration_s + 0.1, period_s)
    told_mm = np.array([offset_mm(sweep, at_s) for at_s in told_s])
    sensing = plant.late_sensing
    force_age_s = (sensing.delay_cycles + 0.5 * (sensing.every_cycles - 1)) * period_s
    followed = SweepRecord(
        told_s, told_mm, np.full(len(told_s), force_age_s), told_s, _positions(plant, told_mm), np.zeros(len(told_s)), 0
    )
    drive = Identity("simulated", str(plant.bandwidth_Hz), "")
    found = identify(drive, wiring, sweep, followed, datetime.now(UTC), "simulated")
    return found.model_copy(update={"force_filter_s": sensing.filter_s})


def _positions(plant: Plant, told_mm: Column) -> Column:
    """The axis in the air at each cycle, as its encoder counts."""
    state, contact_state, found = at_rest(0.0), (0.0, 0.0), np.empty(len(told_mm))
    bench = plant.bench(limb_of(model_of("average"), 1.0), np.zeros(1))
    for at, target_mm in enumerate(told_mm):
        found[at] = round(state.position_mm / COUNT_MM) * COUNT_MM
        state, contact_state = moved_compiled()(
            state, contact_state, bench.motor, bench.loop, bench.sensing, bench.limb, bench.contact, target_mm, 8,
            FAR_MM, FAR_MM,
        )  # fmt: skip
    return found


@lru_cache
def model_of(subject: str) -> Model:
    """The subject's tissue as a model knows it."""
    tissue = load_parameters(FOLDER / f"{subject}.toml").tissue
    return index_model(tissue.a_N_mm, tissue.b_per_mm, tissue.damping_N_s_mm, force_N=MODELLED_N)


def limb_of(model: Model, stiffness: float) -> ModelledLimb:
    """The tissue of ``model``, so many times as stiff."""
    depths = np.linspace(0.0, BEYOND * model.valid.depth_mm, CURVE_POINTS)
    return ModelledLimb(depths, stiffness * np.asarray(model.law.force(depths)), model.damping_N_s_mm, FAR_MM)


def bone_limb(soft_N_mm: float, bone_N_mm: float, at_mm: float, damping_N_s_mm: float) -> ModelledLimb:
    """A soft layer on something stiff."""
    depths = np.linspace(0.0, 40.0, 8 * CURVE_POINTS)
    forces = soft_N_mm * depths + (bone_N_mm - soft_N_mm) * np.maximum(depths - at_mm, 0.0)
    return ModelledLimb(depths, forces, damping_N_s_mm, FAR_MM)
