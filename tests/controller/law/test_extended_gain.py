"""What an extended model gains in control: the loop's own law on the mock bench's physics, on a virtual clock."""

from collections import deque
from dataclasses import replace

import numpy as np

from controller.experiments.tracking import force_law
from controller.law import force_position
from controller.law.force_position import ForceReading
from controller.law.inverse_model import columns
from mock_devices.bench import Bench
from mock_devices.parameters import Parameters
from mock_devices.testing.models import index_model
from rig.config.wiring import Wiring
from rig.tissue.laws import Index
from rig.tissue.laws_extended import Extended
from rig.tissue.model import Model
from tests.mock_devices.playing import settle

MS_NS = 1_000_000
# A command takes two cycles to the axis, a force one to the loop.
COMMAND_TICKS, LATE_TICKS = 2, 1
LIMB = {"a_N_mm": 0.12, "b_per_mm": 0.22, "damping_N_s_mm": 0.01}
FRICTION = {"level_N": 0.2, "slip_length_mm": 0.05}


def wanted_N(cycle: int) -> float:
    """A sine of 1.5 Hz about 2 N."""
    return min(2.0, 0.1 + 2e-3 * cycle) + (np.sin(2 * np.pi * 1.5e-3 * (cycle - 1000)) if cycle > 1000 else 0.0)


def rms_error_N(model: Model, in_time: bool = True) -> float:
    """On a bench with guide friction, after the first second; ``in_time``: asked for as early as the axis needs it."""
    bench = Bench(Parameters.model_validate({"hide": {"friction": FRICTION}}))
    settle(bench, 19.5, 1.0)
    zero_N, place_mm = bench.force.wrench()[2], 19.5
    step = force_law(model, Wiring())
    early = round(1e3 * step.preview_s) if in_time else 0
    table, settings = columns(step.gains), step.settings
    memory = force_position.begin(table, settings.inverse, 0.0)
    sensed = deque([0.0] * LATE_TICKS, maxlen=LATE_TICKS)
    commanded = deque([place_mm] * COMMAND_TICKS, maxlen=COMMAND_TICKS)
    start_ns, errors = bench.now_ns, []
    for cycle in range(4000):
        measured = ForceReading(sensed[0], cycle)
        move_mm, memory = force_position.increment(memory, table, settings, wanted_N(cycle + early), measured, 1e-3)
        place_mm += move_mm
        bench.axis.target(commanded[0])
        commanded.append(place_mm)
        bench.advance(start_ns + (cycle + 1) * MS_NS)
        sensed.append(zero_N - bench.force.wrench()[2])
        errors.append(sensed[-1] - wanted_N(cycle))
    return float(np.sqrt(np.mean(np.square(errors[1000:]))))


def test_a_model_that_knows_the_friction_tracks_better_than_one_that_does_not() -> None:
    plain = replace(index_model(0.12, 0.22, 0.01, force_N=8.0), law=Index(**LIMB))
    law = Extended(**LIMB, friction_N=FRICTION["level_N"], friction_length_mm=FRICTION["slip_length_mm"])
    known = {p.name: (p.value, p.value) for p in law.parameters}
    knowing = replace(plain, law=law, covariance=np.zeros((len(law.values), len(law.values))), intervals=known)
    assert rms_error_N(knowing) < 0.8 * rms_error_N(plain)
    assert rms_error_N(knowing) < 0.4 * rms_error_N(knowing, in_time=False)
