"""The loop on a virtual clock: in time as over frequency, against the bench's own physics, and stopped."""

import math

import numpy as np
import pytest

from controller.experiments import comparison, tracking
from controller.experiments.references import parse_reference
from controller.law.gain_table import gain_rows
from controller.law.loop_response import Constants, Rates, TrueTissue, open_loop
from controller.loop.modes import Mode
from controller.loop.steps import TrackForce
from controller.simulated import bench as simulated
from controller.simulated.bench import MOTOR, POSITION_LOOP, SENSING, SimulatedBench, follow, limb_of
from controller.simulated.segments import hold_compiled
from mock_devices.bench import Bench
from mock_devices.parameters import Parameters
from mock_devices.testing.made.subjects import RESPONSE, subject
from rig.config.wiring import Wiring
from rig.errors import CheckFailed
from rig.simulation import axis_plant
from rig.simulation.axis_plant import ModelledLimb, at_rest

WIRING = Wiring()
STAIRS_N = np.repeat([1.0, *range(1, 5)], 1500).astype(float)
QUIET = SENSING._replace(noise_N=0.0, quantum_N=0.0)
SMOOTH = MOTOR._replace(coulomb_N_m=0.0)


@pytest.mark.parametrize("force_N", [1.0, 5.0, 10.0])
def test_the_step_in_time_is_the_one_over_frequency(force_N: float) -> None:
    """Feedback alone, a step small enough for one tangent, without noise and dry friction, which lags by 1 ms.

    The step response is the inverse Fourier sum of L / (1 + L) over one second of a square wave.
    """
    model = subject("average")
    (row,) = gain_rows(model, [model.depth_mm(force_N)])
    law = Constants(60.0, 0.003, 10.0)
    step = TrackForce(times_s=(0.0, 1.0), forces_N=(0.0, 1.0), gains=(row.model_copy(update={"force_N": 0.0}), row),
                      ahead_mm_s=0.0, speed_limit_mm_s=500.0, **law._asdict())  # fmt: skip
    reference_N = np.full(4000, force_N)
    reference_N[3000:] += 0.02
    trace = follow(step, reference_N, SimulatedBench(limb_of(model), SMOOTH, POSITION_LOOP, QUIET))
    in_time = (trace.sensed_N[3000:] - force_N) / 0.02
    turns = 2 * np.arange(500) + 1
    omega = np.asarray(np.pi * turns, dtype=np.float64)
    tissue = TrueTissue(row.tangent_N_mm / row.damping_N_s_mm, 1.0, 1.0)
    loop = open_loop(RESPONSE, Rates(0.001, 0.001), law, tissue, omega)
    closed, time_s = loop / (1 + loop), np.arange(1000) * 1e-3
    waves = np.exp(1j * np.outer(time_s, omega)) * (closed / (1j * turns))
    expected = 0.5 + 2 / np.pi * np.real(waves.sum(axis=1))
    assert np.sqrt(np.mean((in_time - expected)[5:] ** 2)) < 0.02
    assert np.max(np.abs(in_time - expected)[5:]) < 0.08


def response(force_N: list[float], command_mm: list[float], frequency_Hz: float) -> complex:
    """Complex gain over the last second, the frequency being a whole number of Hz."""
    turn = np.exp(-2j * np.pi * frequency_Hz * np.arange(1000) * 1e-3)
    return complex(np.sum(np.array(force_N[-1000:]) * turn) / np.sum(np.array(command_mm[-1000:]) * turn))


@pytest.mark.parametrize("frequency_Hz", [5, 10, 20, 30])
def test_the_plant_answers_as_the_mock_benchs_drive_and_as_the_design_assumes(frequency_Hz: int) -> None:
    swing = [0.2 * math.sin(2 * math.pi * frequency_Hz * cycle * 1e-3) for cycle in range(1500)]
    parameters = Parameters.model_validate(
        {"tissue": {"a_N_mm": 1.0, "b_per_mm": 0.0, "damping_N_s_mm": 0.0}, "axis": {"start_mm": 25.0},
         "force": {"noise_N": 0.0, "quantum_N": 0.0, "compression": "positive"}}
    )  # fmt: skip
    mock, measured = Bench(parameters), []
    mock.axis.power(True)
    for cycle, mm in enumerate(swing, 1):
        mock.advance(cycle * 1_000_000)
        measured.append(mock.force.wrench()[2])
        mock.axis.target(25.0 + mm)
    depths = [0.0, 100.0]
    state, limb, ours = at_rest(25.0), ModelledLimb(depths, depths, 0.0), []
    hold = hold_compiled()
    for mm in swing:
        ours.append(state.sensed_N)
        state = hold(
            state, MOTOR, POSITION_LOOP, ModelledLimb(np.array(depths), np.array(depths), 0.0), SENSING, 25.0 + mm, 8
        )
    theirs, mine = response(measured, swing, frequency_Hz), response(ours, swing, frequency_Hz)
    assert abs(mine) == pytest.approx(abs(theirs), rel=0.05)
    assert np.degrees(np.angle(mine / theirs)) == pytest.approx(0.0, abs=10.0)
    assert limb.damping_N_s_mm == 0.0
    assert abs(mine) == pytest.approx(1 / math.hypot(1, frequency_Hz / 34.0), rel=0.05)


def test_the_motor_at_constant_voltage_runs_at_the_speed_its_back_emf_allows() -> None:
    """U = R i + Ke w with torque equal to friction, at rest electrically and mechanically."""
    motor = MOTOR._replace(supply_V=3.0, coulomb_N_m=0.0)
    empty = ModelledLimb([0.0, 1.0], [0.0, 0.0], 0.0, surface_mm=1e6)
    state = at_rest(0.0)
    for _ in range(4000):
        state = axis_plant.step(state, motor, POSITION_LOOP, empty, SENSING, 1e5)
    balance_A = motor.viscous_N_m_s * state.speed_rad_s / motor.torque_N_m_A
    assert state.voltage_V == 3.0
    assert state.current_A == pytest.approx(balance_A, rel=1e-3)
    assert motor.resistance_Ohm * balance_A + motor.back_emf_V_s_rad * state.speed_rad_s == pytest.approx(3.0, rel=1e-3)


def test_a_whole_program_runs_through_the_machine_and_tracks_as_the_law_alone_does() -> None:
    model = subject("average")
    program = tracking.following(parse_reference("stairs:3,each_s=1.5"), model, WIRING)
    trace = simulated.run(program, WIRING, SimulatedBench(limb_of(model)))
    assert list(dict.fromkeys(trace.mode.tolist())) == [
        Mode.FREE, Mode.APPROACH, Mode.CONTACT, Mode.RETRACT, Mode.COMPRESS, Mode.IDLE
    ]  # fmt: skip
    through_machine = comparison.jumps(trace.time_s, trace.reference_N, trace.sensed_N, trace.mode)
    alone = follow(tracking.force_law(model, WIRING), STAIRS_N[:6000], SimulatedBench(limb_of(model)))
    for a, b in zip(
        through_machine, comparison.jumps(alone.time_s, alone.reference_N, alone.sensed_N, alone.mode), strict=True
    ):
        assert a.settling_s == pytest.approx(b.settling_s, abs=0.02)
        assert a.error_N == pytest.approx(b.error_N, abs=0.005)


@pytest.mark.parametrize(
    ("reference", "breathing_mm", "every_cycles"), [("stairs:3,each_s=0.5", 1.0, 1), ("knead:2,duration_s=3", 0.0, 10)]
)
def test_stretches_in_machine_code_change_nothing_of_a_run(
    reference: str, breathing_mm: float, every_cycles: int
) -> None:
    model = subject("average")
    program = tracking.following(parse_reference(reference), model, WIRING)
    bench = SimulatedBench(limb_of(model, 1.3, breathing_mm), sensing=SENSING._replace(every_cycles=every_cycles))
    stretched, ticked = (simulated.run(program, WIRING, bench, way) for way in (True, False))
    for ours, theirs in zip(stretched, ticked, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


def test_a_limit_ends_the_simulation_with_its_sentence() -> None:
    model = subject("average")
    program = tracking.following(parse_reference("step:5"), model, WIRING)
    with pytest.raises(CheckFailed, match=r"the simulated run was stopped: depth .* mm is above 15 mm"):
        simulated.run(program, WIRING, SimulatedBench(limb_of(model, stiffness=0.1)))
