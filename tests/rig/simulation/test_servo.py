"""A servo axis in closed loop: closed forms, another integrator, and what its record says of before it began."""

import math
from pathlib import Path

import numpy as np
import pytest

from rig.errors import UsageError
from rig.intake.mapping import Controller
from rig.simulation.servo import follow, read_models, run_up
from tests.rig.diagnosis.made_axis import Array

LOOP = Controller(
    position_gain_per_s=160.0, velocity_gain=243.0, effort_per_control=35.0, limit=10.0, velocity_samples=2
)
AXIS = {"inertia": 50.0, "viscous": 150.0, "coulomb": 12.0, "offset": 3.0}
MODELS = """
[theirs]
inertia = 95.0
viscous = 200.0
"""


def ramp(speed: float, count: int = 2000) -> Array:
    return np.asarray(speed * 1e-3 * np.arange(count), float)


@pytest.mark.parametrize("speed", [0.1, -0.1])
def test_at_constant_speed_the_effort_is_friction_and_offset(speed: float) -> None:
    effort = follow(ramp(speed), None, 1e-3, LOOP, {**AXIS, "asymmetry": -30.0, "stribeck": 5.0, "stribeck_speed": 0.1})
    dry = 12.0 + 5.0 * math.exp(-1)
    drag = 150 * speed - 30 * abs(speed) + math.copysign(dry, speed)
    assert effort[-100:].mean() == pytest.approx(3.0 + drag, rel=1e-3)


def test_loads_along_the_axis_are_in_the_effort() -> None:
    loads = {"position_load": 40.0, "centre": 0.1, "ripple_sin": 2.0, "ripple_pitch": 0.05, "gravity_cos": 4.0}
    slow = ramp(0.01, 20_000)
    effort = follow(slow, None, 1e-3, LOOP, {**AXIS, **loads})
    lag = (effort / 35 / 243 + 0.01) / 160
    place = slow - lag
    load = 40 * (place - 0.1) + 2 * np.sin(2 * np.pi * place / 0.05) + 4 * np.cos(place)
    assert (effort - load)[2000:] == pytest.approx(3 + 1.5 + 12, abs=0.1)


def test_it_agrees_with_another_integrator() -> None:
    """The same axis at 16 kHz with friction smoothed over 0.1 mm/s."""
    time = np.arange(4000) * 1e-3
    wish = 0.05 * (1 - np.cos(2 * np.pi * 0.6 * time))
    place, speed, seen, control = 0.0, 0.0, [0.0, 0.0], np.empty(4000)
    for k, reference in enumerate(wish.tolist()):
        control[k] = np.clip(243 * (160 * (reference - place) - (place - seen[0]) / 2e-3), -10, 10)
        seen = [seen[1], place]
        for _ in range(16):
            force = 35 * control[k] - 3 - 150 * speed - 12 * math.tanh(speed / 1e-4)
            speed += 6.25e-5 * force / 50
            place += 6.25e-5 * speed
    effort = follow(np.asarray(wish), None, 1e-3, LOOP, AXIS)
    assert np.linalg.norm(effort - 35 * control) < 0.01 * np.linalg.norm(35 * control)


def test_excitation_is_added_within_the_limit() -> None:
    still, pulse = np.zeros(100), np.zeros(100)
    pulse[50:] = 20.0
    effort = follow(still, pulse, 1e-3, LOOP, AXIS)
    assert effort[50] == pytest.approx(35 * 10.0)
    assert np.abs(effort[:50]).max() < 15.1


def test_a_dead_time_moves_the_axis_later_by_whole_samples() -> None:
    pulse = np.zeros(300)
    pulse[100] = 5.0
    plain, late = (follow(np.zeros(300), pulse, 1e-3, LOOP, {"inertia": 50.0, "dead_time": s}) for s in (0.0, 0.0035))
    first = [int(np.flatnonzero(np.abs(np.delete(effort, 100)) > 1e-9)[0]) for effort in (plain, late)]
    assert first[1] - first[0] == 3


def test_a_record_that_begins_in_motion_is_run_up_from_rest() -> None:
    whole = 0.5 * 0.8 * (np.arange(400, dtype=np.float64) * 1e-3) ** 2
    before = run_up(whole[16:])
    assert before == pytest.approx(whole[16 - len(before) : 16], abs=1e-9)
    assert whole[16 - len(before)] < 1e-6
    effort = follow(whole, None, 1e-3, LOOP, AXIS)
    assert follow(whole[16:], None, 1e-3, LOOP, AXIS) == pytest.approx(effort[16:], abs=2.0)


@pytest.mark.parametrize("setpoint", [np.zeros(50), ramp(0.1), -(ramp(0.1) ** 2) + 1])
def test_a_record_that_begins_otherwise_is_not(setpoint: Array) -> None:
    assert len(run_up(setpoint)) <= 1


def test_models_of_others_are_read_and_their_keys_checked(tmp_path: Path) -> None:
    file = tmp_path / "models.toml"
    file.write_text(MODELS)
    assert read_models(file)["theirs"]["viscous"] == 200.0
    file.write_text(MODELS.replace("viscous", "viscosity"))
    with pytest.raises(UsageError, match=r"models\.toml: theirs: unknown key viscosity; nearest valid key: viscous"):
        read_models(file)
