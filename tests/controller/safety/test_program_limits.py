"""A program is refused before it moves, with the number that is wrong and its bound; at the bound it is taken."""

import re

import pytest

from controller.law.inverse_model import GainRow
from controller.loop.steps import Approach, Compress, Dither, Hold, MoveTo, Program, Retract, Step, TrackForce, Zero
from controller.safety.program_limits import refuse_beyond_limits
from rig.config.wiring import Wiring
from rig.errors import UsageError

WIRING = Wiring.model_validate(
    {
        "limits": {"force_N": 10.0, "depth_mm": 15.0, "position_max_mm": 60.0, "speed_mm_s": 60.0,
                   "retract_speed_mm_s": 20.0}
    }
)  # fmt: skip
# A millimetre deeper for each newton more, and two beyond 8 N.
ROWS = tuple(
    GainRow(force_N=force_N, depth_mm=depth_mm, tangent_N_mm=1.0, damping_N_s_mm=0.01)
    for force_N, depth_mm in ((0.0, 10.0), (8.0, 14.0), (9.0, 16.0), (12.0, 18.0))
)
ZERO = Zero(duration_s=0.5)


def approach(**values: float) -> Approach:
    given = {"speed_mm_s": 5.0, "contact_force_N": 0.1, "search_to_mm": 30.0} | values
    return Approach(**given)  # type: ignore[arg-type]


def touching(**values: float) -> Approach:
    return approach(touches=2, **values)


def pressing(depth_mm: float = 5.0, speed_mm_s: float = 5.0, force_limit_N: float = 5.0) -> Compress:
    return Compress(depth_mm=depth_mm, speed_mm_s=speed_mm_s, force_limit_N=force_limit_N)


def track(*points: tuple[float, float], rows: tuple[GainRow, ...] = ROWS, **values: float) -> TrackForce:
    times_s, forces_N = zip(*points, strict=True)
    return TrackForce(times_s=times_s, forces_N=forces_N, gains=rows, crossover_rad_s=30.0, **values)  # type: ignore[arg-type]


def refused(*steps: Step) -> str:
    with pytest.raises(UsageError) as refusal:
        refuse_beyond_limits(Program(name="press", steps=steps), WIRING)
    return str(refusal.value)


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        (pressing(depth_mm=16.0), "depth 16 mm is above limits.depth_mm, 15 mm"),
        (pressing(speed_mm_s=99.0), "speed 99 mm/s is above limits.speed_mm_s, 60 mm/s"),
        (pressing(force_limit_N=12.0), "force_limit_N 12 N is above the force limit, 10 N"),
        (MoveTo(position_mm=70.0, speed_mm_s=5.0), "position 70 mm is outside 0 to 60 mm"),
        (MoveTo(position_mm=-1.0, speed_mm_s=5.0), "position -1 mm is outside 0 to 60 mm"),
        (MoveTo(position_mm=7.0, speed_mm_s=61.0), "speed 61 mm/s is above limits.speed_mm_s, 60 mm/s"),
        (approach(search_to_mm=70.0), "search_to_mm 70 mm is outside 0 to 60 mm"),
        (approach(speed_mm_s=61.0), "speed 61 mm/s is above limits.speed_mm_s, 60 mm/s"),
        (approach(contact_force_N=11.0), "contact_force_N 11 N is above the force limit, 10 N"),
        (touching(touch_speed_mm_s=99.0), "touch speed 99 mm/s is above limits.speed_mm_s, 60 mm/s"),
        (touching(back_off_mm_s=30.0), "back-off speed 30 mm/s is above limits.retract_speed_mm_s, 20 mm/s"),
        (
            Dither(amplitude_mm=0.5, frequency_Hz=20.0, duration_s=1.0),  # 2 pi 20 0.5
            "speed of the dither 62.8319 mm/s is above limits.speed_mm_s, 60 mm/s",
        ),
        (
            Retract(clearance_mm=1.0, speed_mm_s=30.0),
            "retract speed 30 mm/s is above limits.retract_speed_mm_s, 20 mm/s",
        ),
        (
            track((0.0, 0.0), (1.0, 10.5), rows=(*ROWS[:2], ROWS[3].model_copy(update={"depth_mm": 15.0}))),
            "reference force 10.5 N is above the force limit, 10 N",
        ),
        (
            track((0.0, 0.0), (1.0, 8.5), (2.0, 1.0), rows=(*ROWS[:2], ROWS[2].model_copy(update={"depth_mm": 17.0}))),
            "depth of it by the model 15.5 mm is above limits.depth_mm, 15 mm",
        ),
        (
            track((0.0, 0.0), (1.0, 9.0), rows=ROWS[:2]),
            "reference force 9 N is above the largest force of the model, 8 N",
        ),
        (track((0.0, 1.0), (2.0, 1.0), (1.0, 1.0)), "the reference's times go backwards"),
        (
            track((0.0, 1.0), (9.0, 1.0), (1201.0, 1.0), repeats=3),
            "duration of the reference 3603 s is above an hour, 3600 s",
        ),
        (track((0.0, 1.0), (1.0, 1.0), speed_limit_mm_s=61.0), "speed 61 mm/s is above limits.speed_mm_s, 60 mm/s"),
        (
            TrackForce(times_s=(0.0, 1.0, 2.0), forces_N=(1.0, 1.0), gains=ROWS, crossover_rad_s=30.0),
            "the reference has 3 times but 2 forces",
        ),
    ],
)
def test_what_is_beyond_a_limit_is_refused_with_the_number_and_its_bound(step: Step, reason: str) -> None:
    assert refused(ZERO, approach(), step) == f"press refused before moving: {reason}"


@pytest.mark.parametrize(
    "step",
    [
        pressing(depth_mm=15.0),
        pressing(speed_mm_s=60.0),
        pressing(force_limit_N=10.0),
        MoveTo(position_mm=60.0, speed_mm_s=60.0),
        MoveTo(position_mm=0.0, speed_mm_s=5.0),
        approach(search_to_mm=60.0, contact_force_N=10.0),
        touching(touch_speed_mm_s=60.0, back_off_mm_s=20.0),
        approach(touch_speed_mm_s=99.0, back_off_mm_s=99.0),  # without touches nothing moves so
        Dither(amplitude_mm=0.25, frequency_Hz=38.0, duration_s=1.0),  # 59.7 mm/s
        Retract(clearance_mm=1.0, speed_mm_s=20.0),
        track((0.0, 8.0), (1.0, 8.0), (1.0, 1.0), rows=ROWS[:2]),
        track((0.0, 1.0), (1800.0, 1.0), repeats=2),
        Hold(duration_s=1e6),
    ],
)
def test_at_its_bound_a_step_is_taken(step: Step) -> None:
    refuse_beyond_limits(Program(name="press", steps=(ZERO, approach(), step)), WIRING)


def test_all_that_is_wrong_is_said_at_once_and_each_thing_once() -> None:
    fast = Retract(clearance_mm=1.0, speed_mm_s=30.0)
    assert refused(ZERO, approach(), pressing(depth_mm=16.0), fast, fast) == (
        "press refused before moving: depth 16 mm is above limits.depth_mm, 15 mm;"
        " retract speed 30 mm/s is above limits.retract_speed_mm_s, 20 mm/s"
    )


@pytest.mark.parametrize(("step", "word"), [(pressing(), "compress"), (track((0.0, 1.0), (1.0, 1.0)), "track")])
def test_nothing_presses_on_a_surface_that_was_not_looked_for(step: Step, word: str) -> None:
    assert refused(ZERO, step, approach()) == (
        f"press refused before moving: a {word} step needs the surface, but no approach comes before it"
    )


@pytest.mark.parametrize(
    "steps", [(approach(), pressing()), (Retract(clearance_mm=1.0, speed_mm_s=5.0), approach(), ZERO)]
)
def test_what_does_more_than_leave_begins_with_a_zero(steps: tuple[Step, ...]) -> None:
    assert re.search("the first step must be a zero: without a reference zero no force limit holds$", refused(*steps))


@pytest.mark.parametrize(
    "steps",
    [(Retract(clearance_mm=1.0, speed_mm_s=5.0),), (Hold(duration_s=1.0), Retract(clearance_mm=1.0, speed_mm_s=5.0))],
)
def test_who_only_leaves_needs_none(steps: tuple[Step, ...]) -> None:
    refuse_beyond_limits(Program(name="leave", steps=steps), WIRING)
