"""References: what each means, and every bad one refused with its number and bound before anything moves."""

from pathlib import Path

import pytest

from controller.experiments import tracking
from controller.experiments.references import parse_reference
from controller.loop.steps import Approach, TrackForce
from controller.safety.program_limits import refuse_beyond_limits
from mock_devices.testing.models import index_model
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Wiring
from rig.errors import UsageError

MODEL = index_model(0.12, 0.22, 0.01, force_N=11.0)


def test_a_step_rests_at_its_base_and_jumps() -> None:
    step = parse_reference("step:5,base_N=1,duration_s=2")
    assert (step.times_s, step.forces_N) == ((0.0, 1.0, 1.0, 3.0), (1.0, 1.0, 5.0, 5.0))


def test_stairs_jump_up_or_down() -> None:
    assert parse_reference("stairs:3,each_s=1").forces_N == (1.0, 1.0, 2.0, 2.0, 3.0, 3.0)
    assert parse_reference("stairs:1,from_N=2,each_s=1").forces_N == (2.0, 2.0, 1.0, 1.0)


def test_a_ramp_has_the_rate_asked_for() -> None:
    assert parse_reference("ramp:4,base_N=1,rate_N_s=2,hold_s=1").times_s == (0.0, 1.5, 2.5)


@pytest.mark.parametrize(
    ("text", "low_N", "high_N", "duration_s"),
    [
        ("sine:0.5,mean_N=2,frequency_Hz=5,duration_s=3", 1.5, 2.5, 3.0),
        ("vibrate:0.4,mean_N=3,frequency_Hz=8,duration_s=2", 2.6, 3.4, 2.0),
        ("press:3,base_N=0.5,frequency_Hz=0.5,duration_s=4", 0.5, 3.5, 4.0),
        ("knead:2,base_N=1,frequency_Hz=0.5,dwell=0.3,duration_s=4", 1.0, 3.0, 4.0),
    ],
)
def test_a_periodic_reference_has_amplitude_frequency_and_duration(
    text: str, low_N: float, high_N: float, duration_s: float
) -> None:
    reference = parse_reference(text)
    assert min(reference.forces_N) == pytest.approx(low_N, abs=1e-3)
    assert max(reference.forces_N) == pytest.approx(high_N, abs=1e-3)
    assert reference.duration_s == pytest.approx(duration_s)


def test_kneading_dwells_above_for_its_share_of_the_period() -> None:
    knead = parse_reference("knead:2,base_N=1,frequency_Hz=1,dwell=0.3")
    held = [t for t, force in zip(knead.times_s, knead.forces_N, strict=True) if force == 3.0]
    assert max(held) - min(held) == pytest.approx(0.3, abs=0.02)


def write(tmp_path: Path, text: str) -> str:
    file = tmp_path / "force.csv"
    file.write_text(text)
    return f"csv:{file}"


def test_a_csv_file_is_followed_from_its_first_time_on(tmp_path: Path) -> None:
    reference = parse_reference(write(tmp_path, "time_s,force_N\n2.0,1.0\n3.0,2.5\n"))
    assert (reference.times_s, reference.forces_N) == ((0.0, 1.0), (1.0, 2.5))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time_s,force_N\n0,1\n1,nan\n", "line 3: force_N is nan; it must be finite"),
        ("time_s,force_N\n0,1\n0,2\n", "line 3: time_s 0 does not come after 0; it must grow"),
        ("time_s,force_N\n0,1\n-1,2\n", "line 3: time_s -1 does not come after 0"),
        ("time_s,force_N\n0,1\n1,x\n", "line 3: force_N 'x' is not a number"),
        ("time_s,force_N\n0,1\n1\n", "line 3: force_N '' is not a number"),
        ("time_s,force_N\n0,1\n", "has 1 points; a reference has 2 to 4000"),
        ("t,f\n0,1\n", "needs columns time_s and force_N in its first line; it has t, f"),
    ],
)
def test_a_csv_file_that_cannot_be_followed_is_refused_with_its_line(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        parse_reference(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("stepp:5", "'stepp' is none of step, ramp"),
        ("step:x", "'x' is not a number"),
        ("step:5,forse_N=2", "unknown key forse_N; nearest valid key: force_N"),
        ("step:-1", "force_N: Input should be greater than 0"),
        ("sine:2,mean_N=1", "amplitude_N 2 must stay below mean_N 1"),
        ("knead:2,dwell=0.6", "dwell: Input should be less than 0.5"),
        ("step:nan", "force_N: Input should be a finite number"),
    ],
)
def test_a_reference_that_means_nothing_is_refused(text: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        parse_reference(text)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("step:11.5", "11.5 N is outside what the model was fitted to, 0 to 11 N"),
        ("sine:0.5,mean_N=2,frequency_Hz=30", "30 Hz is above half the axis' bandwidth, 17 Hz"),
        ("sine:0.99,mean_N=1.02,frequency_Hz=5", "falls to 0.03 N, below the contact force 0.05 N"),
        ("sine:1.5,mean_N=2,frequency_Hz=12", "mm/s on this tissue, above the 24 mm/s of the force loop"),
        ("ramp:5,rate_N_s=20", "mm/s on this tissue, above the 24 mm/s of the force loop"),
    ],
)
def test_a_reference_beyond_model_or_axis_is_refused_with_number_and_bound(text: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        tracking.following(parse_reference(text), MODEL, Wiring())


def test_a_reference_beyond_the_pain_threshold_is_refused() -> None:
    wiring = Wiring.model_validate({"subject": {"pain_threshold_N": 4.0}})
    with pytest.raises(UsageError, match="reference force 5 N is above the force limit, 4 N"):
        refuse_beyond_limits(tracking.following(parse_reference("step:5"), MODEL, wiring), wiring)


def test_a_force_deeper_than_the_limit_is_refused_before_it_is_tried() -> None:
    wiring = Wiring.model_validate({"limits": {"depth_mm": 3.0}})
    with pytest.raises(UsageError, match=r"depth of it by the model \d\.\d+ mm is above limits.depth_mm, 3 mm"):
        refuse_beyond_limits(tracking.following(parse_reference("step:5"), MODEL, wiring), wiring)


def test_a_reference_without_end_is_refused() -> None:
    with pytest.raises(UsageError, match=r"duration of the reference 1e\+09 s is above an hour, 3600 s"):
        refuse_beyond_limits(tracking.following(parse_reference("step:5,duration_s=1e9"), MODEL, Wiring()), Wiring())


@pytest.mark.parametrize(
    ("limits", "to_mm"), [({}, 40.0), ({"search_to_mm": 28.0}, 28.0), ({"position_max_mm": 35.0}, 35.0)]
)
def test_the_limb_is_searched_for_within_a_stated_distance(limits: dict[str, float], to_mm: float) -> None:
    program = tracking.following(parse_reference("step:5"), MODEL, Wiring.model_validate({"limits": limits}))
    assert [step.search_to_mm for step in program.steps if isinstance(step, Approach)] == [to_mm]


def test_a_search_that_ends_outside_the_workspace_is_refused() -> None:
    wiring = Wiring.model_validate({"limits": {"search_to_mm": -1.0}})
    with pytest.raises(UsageError, match="search_to_mm -1 mm is outside 0 to 60 mm"):
        refuse_beyond_limits(tracking.following(parse_reference("step:5"), MODEL, wiring), wiring)


def test_a_delay_that_no_law_can_hold_is_refused() -> None:
    wiring = Wiring(axis=Epos4Wiring(delay_ms=60.0))
    with pytest.raises(UsageError, match=r"the axis answers 58\.7 ms late, above the 46 ms that a force law can hold"):
        tracking.following(parse_reference("step:5"), MODEL, wiring)


def test_a_periodic_reference_goes_on_where_the_lead_in_ended_and_repeats() -> None:
    program = tracking.following(parse_reference("press:3,duration_s=4"), MODEL, Wiring())
    tracks = [step for step in program.steps if isinstance(step, TrackForce)]
    assert [track.repeats for track in tracks] == [1, 2]
    assert tracks[0].forces_N[-1] == tracks[1].forces_N[0]
