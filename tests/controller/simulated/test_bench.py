"""The loop on a virtual clock: against python-control, against the bench's own physics, on five subjects, and wrong."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from controller.experiments import comparison, tracking
from controller.experiments.references import parse_reference
from controller.law import transfer_functions
from controller.law.gains import Choice, Design, margins, schedule
from controller.loop.modes import Mode
from controller.loop.steps import TrackForce
from controller.simulated import bench as simulated
from controller.simulated.bench import MOTOR, POSITION_LOOP, SENSING, SimulatedBench, follow, limb_of
from controller.simulated.segments import hold_compiled
from mock_devices.bench import Bench
from mock_devices.parameters import Parameters, load_parameters
from mock_devices.testing.models import index_model
from rig.config.wiring import Wiring
from rig.errors import CheckFailed
from rig.simulation import axis_plant
from rig.simulation.axis_plant import ModelledLimb, at_rest
from rig.tissue.model import Model

WIRING = Wiring()
STAIRS_N = np.repeat([1.0, *range(1, 11)], 1500).astype(float)
QUIET = SENSING._replace(noise_N=0.0, quantum_N=0.0)
SMOOTH = MOTOR._replace(coulomb_N_m=0.0)


@cache
def subject(name: str) -> Model:
    from api.cli.comparison import SUBJECTS  # noqa: PLC0415

    tissue = load_parameters(SUBJECTS / f"{name}.toml").tissue
    return index_model(tissue.a_N_mm, tissue.b_per_mm, tissue.damping_N_s_mm, force_N=11.0)


SUBJECT_NAMES = ("soft", "average", "lean", "firm", "tense")


def worst(step: TrackForce, bench: SimulatedBench, rest_s: float = 0.0) -> dict[str, float | None]:
    trace = follow(step, np.concatenate([np.full(round(1000 * rest_s), STAIRS_N[0]), STAIRS_N]), bench)
    jumps = comparison.jumps(trace.time_s, trace.reference_N, trace.sensed_N, trace.mode)
    return comparison.compared_run("", "", jumps).worst.model_dump()


def law(name: str, choice: Choice = "tangent", adapt: bool = False) -> TrackForce:
    return tracking.force_law(subject(name), WIRING, choice, adapt)


def within(worst: dict[str, float | None], **bounds: float) -> bool:
    return all(value is not None and value < bounds[name] for name, value in worst.items() if name in bounds)


@pytest.mark.parametrize("name", SUBJECT_NAMES)
def test_jumps_of_1_N_settle_without_overshoot_or_error_at_every_depth_of_every_subject(name: str) -> None:
    found = worst(law(name), SimulatedBench(limb_of(subject(name))))
    assert within(found, error_N=0.02, error_percent=0.5, overshoot_percent=5.0, settling_s=0.4), found


@pytest.mark.parametrize("stiffness", [0.5, 1.5])
@pytest.mark.parametrize("name", SUBJECT_NAMES)
def test_tissue_half_or_half_again_as_stiff_as_the_model_still_settles(name: str, stiffness: float) -> None:
    found = worst(law(name), SimulatedBench(limb_of(subject(name), stiffness)))
    assert within(found, error_N=0.02, error_percent=0.5, overshoot_percent=8.0, settling_s=0.4), found


@pytest.mark.parametrize("name", SUBJECT_NAMES)
def test_constant_stiffness_overshoots_at_least_twice_as_much(name: str) -> None:
    bench = SimulatedBench(limb_of(subject(name)))
    ours, theirs = worst(law(name), bench), worst(law(name, "constant"), bench)
    assert (theirs["overshoot_percent"] or 0) > 2 * (ours["overshoot_percent"] or 0)


def test_plain_admittance_is_at_least_twice_as_slow() -> None:
    bench = SimulatedBench(limb_of(subject("average")))
    ours, theirs = worst(law("average"), bench), worst(law("average", "admittance"), bench)
    assert (theirs["settling_s"] or math.inf) > 2 * (ours["settling_s"] or math.inf)


@pytest.mark.parametrize("rest_s", [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5])
def test_jumps_on_a_breathing_surface_settle_as_well_whenever_they_come(rest_s: float) -> None:
    found = worst(law("average"), SimulatedBench(limb_of(subject("average"), breathing_mm=1.5)), rest_s)
    assert within(found, error_N=0.02, error_percent=0.5, overshoot_percent=5.0, settling_s=0.4), found


def test_a_sensor_of_100_Hz_is_followed_without_overshoot_and_its_noise_is_played_back_only_in_part() -> None:
    sensing = SENSING._replace(filter_s=0.003, noise_N=0.05, quantum_N=0.01, delay_cycles=4, every_cycles=10)
    slow = Wiring.model_validate({"force": {"product": "robotiq-ft300"}})
    step = tracking.force_law(subject("average"), slow, "tangent", False)
    quiet = SimulatedBench(limb_of(subject("average")), sensing=sensing._replace(noise_N=0.0))
    assert within(worst(step, quiet), error_N=0.02, overshoot_percent=5.0, settling_s=0.4)
    trace = follow(step, np.full(20_000, 5.0), SimulatedBench(limb_of(subject("average")), sensing=sensing))
    assert np.std(trace.force_N[5000:]) < 0.5 * sensing.noise_N


def test_the_second_integral_divides_what_breathing_leaves_of_error() -> None:
    bench = SimulatedBench(limb_of(subject("average"), breathing_mm=1.5))
    still = law("average").model_copy(update={"drift_Hz": 0.0})
    with_drift, without = worst(law("average"), bench), worst(still, bench)
    assert (with_drift["largest_error_N"] or math.inf) < 0.5 * (without["largest_error_N"] or 0)


def test_a_sine_of_5_Hz_is_followed_in_amplitude() -> None:
    sine = parse_reference("sine:0.5,mean_N=2,frequency_Hz=5,duration_s=4")
    reference_N = np.interp(np.arange(4000) * 1e-3 % sine.times_s[-1], sine.times_s, sine.forces_N)
    for name in SUBJECT_NAMES:
        trace = follow(law(name), reference_N, SimulatedBench(limb_of(subject(name))))
        turn = np.exp(-2j * np.pi * 5.0 * trace.time_s[2000:])
        ratio = abs(np.mean(trace.force_N[2000:] * turn)) / abs(np.mean(reference_N[2000:] * turn))
        assert ratio == pytest.approx(1.0, abs=0.1), name


@pytest.mark.parametrize("force_N", [1.0, 5.0, 10.0])
def test_the_step_in_time_is_the_one_of_the_transfer_functions(force_N: float) -> None:
    """Feedback alone, a step small enough for one tangent, without noise and dry friction, which lags by 1 ms."""
    model = subject("average")
    design = Design(34.0, 0.003, 10.0, 55.0)
    row = schedule(model, design, (0.0, model.depth_mm(force_N)))[-1]
    step = TrackForce(times_s=(0.0, 1.0), forces_N=(0.0, 1.0), gains=(row.model_copy(update={"force_N": 0.0}), row),
                      ahead_mm_s=0.0, damping_N_s_mm=model.damping_N_s_mm, speed_limit_mm_s=500.0)  # fmt: skip
    reference_N = np.full(3500, force_N)
    reference_N[3000:] += 0.05
    trace = follow(step, reference_N, SimulatedBench(limb_of(model), SMOOTH, POSITION_LOOP, QUIET))
    in_time = (trace.sensed_N[3000:] - force_N) / 0.05
    loop = transfer_functions.open_loop(row, row.tangent_N_mm, model.damping_N_s_mm, design)
    expected = transfer_functions.step_response(loop, np.arange(500, dtype=np.float64) * 1e-3)
    assert np.max(np.abs(in_time - expected)) < 0.1
    assert np.sqrt(np.mean((in_time - expected) ** 2)) < 0.01


def test_margins_agree_with_python_control() -> None:
    import control  # noqa: PLC0415

    model, design = subject("firm"), tracking.design_for(WIRING)
    for row in law("firm").gains[5::10]:
        gain, phase, _, crossover = control.margin(
            transfer_functions.open_loop(row, row.tangent_N_mm, model.damping_N_s_mm, design)
        )
        ours = margins((row.proportional_mm_N, row.integral_mm_N_s), row.tangent_N_mm, model.damping_N_s_mm, design)
        assert ours.crossover_Hz == pytest.approx(crossover / (2 * math.pi), rel=1e-3)
        assert ours.phase_deg == pytest.approx(phase, abs=0.1)
        assert ours.gain == pytest.approx(gain, rel=0.02)


@pytest.mark.parametrize(
    ("stiffness", "later_s", "least_deg"), [(1.0, 0, 55), (1.5, 0, 39), (0.5, 0, 55), (1.0, 0.002, 42)]
)
def test_the_margins_that_the_documentation_states(stiffness: float, later_s: float, least_deg: float) -> None:
    designed = tracking.design_for(WIRING)
    design = replace(designed, delay_s=designed.delay_s + later_s)
    for name in SUBJECT_NAMES:
        for row in law(name).gains[::3]:
            gains = row.proportional_mm_N, row.integral_mm_N_s
            found = margins(gains, stiffness * row.tangent_N_mm, subject(name).damping_N_s_mm, design)
            assert found.phase_deg > least_deg - 0.5
            assert found.gain > 2.0


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
    alone = follow(law("average"), STAIRS_N[:6000], SimulatedBench(limb_of(model)))
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
