"""Constant-velocity indentation as programs: one a trial, speeds in random order."""

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace

from controller.loop.steps import Approach, Compress, Dither, Hold, Program, Retract, Step, Zero
from controller.loop.touch import BACK_OFF_MM
from rig.config.protocol import Indentation

# 366 portions, two a cycle at 1 kHz, and as much again for cycles missed.
ESTIMATING_S = 0.4


@dataclass(frozen=True)
class PlannedTrial:
    """One trial: its place in the session and what it does; ``repeats`` names the trial it makes again."""

    index: int
    name: str
    speed_mm_s: float
    program: Program
    repeats: str = ""


def trials(protocol: Indentation) -> tuple[PlannedTrial, ...]:
    """All trials of ``protocol`` in the order in which they are to be run; the order depends on the seed alone."""
    speeds = [speed for speed in protocol.speeds_mm_s for _ in range(protocol.trials)]
    if protocol.randomise:
        random.Random(protocol.seed).shuffle(speeds)
    return tuple(_trial(index, speed, protocol) for index, speed in enumerate(speeds, start=1))


def attempts(trial: PlannedTrial, repeats: int) -> Iterator[PlannedTrial]:
    """The trial, and as many repeats of it under names of their own."""
    yield trial
    for number in range(1, repeats + 1):
        yield replace(trial, name=f"{trial.name}_repeat_{number}", repeats=trial.name)


def _trial(index: int, speed_mm_s: float, protocol: Indentation) -> PlannedTrial:
    name = f"trial_{index:03d}"
    program = Program(name=f"{name} at {speed_mm_s:g} mm/s", steps=tuple(_steps(speed_mm_s, protocol)))
    return PlannedTrial(index, name, speed_mm_s, program)


def _steps(speed_mm_s: float, protocol: Indentation) -> list[Step]:
    return [
        Zero(duration_s=protocol.air_dwell_s),
        Approach(
            speed_mm_s=protocol.approach_speed_mm_s,
            contact_force_N=protocol.contact_force_N,
            search_to_mm=protocol.search_to_mm,
            within_mm=protocol.contact_within_mm,
            touches=protocol.touches,
            touch_speed_mm_s=protocol.touch_speed_mm_s,
            back_off_mm_s=protocol.retract_speed_mm_s,
        ),
        Retract(clearance_mm=protocol.run_up_mm, speed_mm_s=protocol.retract_speed_mm_s),
        *_press(protocol.depth_mm, speed_mm_s, protocol),
        *_dither(protocol),
        *(_press(protocol.second_depth_mm, speed_mm_s, protocol) if protocol.second_depth_mm else []),
        Retract(clearance_mm=protocol.clearance_mm, speed_mm_s=protocol.retract_speed_mm_s),
        Hold(duration_s=protocol.rest_s),
    ]


def _press(depth_mm: float, speed_mm_s: float, protocol: Indentation) -> list[Step]:
    return [
        Compress(depth_mm=depth_mm, speed_mm_s=speed_mm_s, force_limit_N=protocol.force_limit_N),
        Hold(duration_s=protocol.hold_s),
    ]


def _dither(protocol: Indentation) -> list[Step]:
    if not (protocol.dither_amplitude_mm and protocol.dither_s):
        return []
    return [
        Dither(
            amplitude_mm=protocol.dither_amplitude_mm,
            frequency_Hz=protocol.dither_frequency_Hz,
            duration_s=protocol.dither_s,
        )
    ]


def longest_s(protocol: Indentation, speed_mm_s: float, travel_mm: float) -> float:
    """A bound on the duration of one trial, from its distances and speeds, with half as much again."""
    way_s = travel_mm / protocol.approach_speed_mm_s + 3 * travel_mm / protocol.retract_speed_mm_s
    press_s = 2 * (protocol.deepest_mm + protocol.run_up_mm) / speed_mm_s
    rests_s = protocol.air_dwell_s + 2 * protocol.hold_s + protocol.dither_s + protocol.rest_s
    return 1.5 * (way_s + press_s + rests_s + _touches_s(protocol, travel_mm)) + 10.0


def _touches_s(protocol: Indentation, travel_mm: float) -> float:
    """A touch goes as deep as the detection, from where the samples that were kept begin."""
    longest_mm = travel_mm + BACK_OFF_MM
    return protocol.touches * (
        longest_mm / protocol.touch_speed_mm_s + longest_mm / protocol.retract_speed_mm_s + ESTIMATING_S
    )
