"""The servo axis: what is hidden in a simulated one, and what real recordings of one show."""

from pathlib import Path

import numpy as np
import pytest

from rig.diagnosis.axis import AxisRecording
from rig.diagnosis.axis_run import diagnose_axis, diagnose_axis_folder
from tests.data import recording


def simulated(coulomb_N: float, seed: int = 1) -> AxisRecording:
    """A mass of 50 kg on a viscous guide under the same loop, integrated at 8 kHz, independently of the project."""
    rng = np.random.default_rng(seed)
    time = np.arange(12_000, dtype=float) * 1e-3
    wish = 0.1 * np.sin(2 * np.pi * 0.3 * time) + 0.05 * np.sin(2 * np.pi * 0.73 * time)
    kp, kv, gain = 160.0, 243.0, 35.0
    place, speed, before = 0.0, 0.0, [0.0, 0.0]
    position, control = np.empty_like(time), np.empty_like(time)
    for k, reference_m in enumerate(wish):
        seen = place + rng.normal(0, 2e-7)
        volts = float(np.clip(kv * (kp * (reference_m - seen) - (seen - before[0]) / 2e-3), -10, 10))
        before = [before[1], seen]
        position[k], control[k] = seen, volts
        for _ in range(8):
            force = gain * volts - 150 * speed - coulomb_N * np.tanh(speed / 1e-4)
            speed += 1.25e-4 * force / 50
            place += 1.25e-4 * speed
    return AxisRecording("simulated", time, position, wish, control, np.zeros_like(time), gain, kp, kv)


def test_coulomb_friction_is_named_and_sized_and_the_closed_loop_gains_by_it() -> None:
    result = diagnose_axis([simulated(12.0)], "axis")
    assert result.findings[0].effects[0] == "coulomb_friction"
    assert result.findings[0].parameters["coulomb_N"].value == pytest.approx(12.0, rel=0.05)
    assert result.simulated[0].after_percent < 0.5 * result.simulated[0].before_percent


def test_an_axis_without_dry_friction_has_none_named() -> None:
    result = diagnose_axis([simulated(0.0)], "axis")
    assert "coulomb_friction" not in {effect for finding in result.findings for effect in finding.effects}


def test_the_real_axis_shows_coulomb_friction_then_asymmetry_and_the_left_out_recording_gains() -> None:
    folder: Path = recording("emps")
    result = diagnose_axis_folder(folder)
    assert [finding.effects[0] for finding in result.findings] == ["coulomb_friction", "asymmetric_friction"]
    assert result.base["mass_kg"].value == pytest.approx(95.1, rel=0.02)
    pulses = next(item for item in result.simulated if not item.fitted)
    assert pulses.recording == "DATA_EMPS_PULSES"
    assert pulses.after_percent < 8.94 < pulses.before_percent
