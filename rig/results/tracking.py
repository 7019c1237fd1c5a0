"""What force tracking found: runs on the bench, subjects compared, simulations, and the subject's threshold."""

from collections.abc import Mapping

from pydantic import AliasChoices, Field

from rig.results.base import Result, SavedResult

FILE = "track.json"
# Of each recording of a ramp, since one session may have several.
THRESHOLD = "threshold.json"


class Plateau(Result):
    """Reference and actual force on one level of the reference; the first second of it is not counted."""

    given_N: float
    actual_N: float
    error_N: float
    error_percent: float
    max_error_N: float
    max_error_percent: float
    rms_error_N: float
    overshoot_percent: float
    settling_s: float | None


class Followed(Result):
    """How well force followed a moving reference, over all contact after the lead-in.

    ``amplitude_ratio`` and ``lag_s`` are those at the reference's strongest frequency; None where it has none.
    """

    rms_error_N: float
    largest_error_N: float
    amplitude_ratio: float | None
    lag_s: float | None


class LoopCount(Result):
    """Cycles of the loop during the run, and those it missed."""

    cycles: int = Field(validation_alias=AliasChoices("cycles", "ticks"))
    missed: int


class TrackingGain(Result):
    """What one model gains over another on the same bench and reference, jumps included."""

    rms_error_before_N: float
    rms_error_after_N: float
    reduction: float


class TrackResult(SavedResult):
    """Reference and actual force, level by level, and where it is recorded."""

    recording: str
    model: str
    max_error_percent: float | None
    rms_error_N: float | None
    levels: tuple[Plateau, ...]
    followed: Followed
    samples: int
    dropped: int
    loop: LoopCount
    quality: str = ""
    reasons: tuple[str, ...] = ()
    against: "TrackResult | None" = Field(default=None, description="the run with the other model, where there is one")
    gain: TrackingGain | None = None


def compare_runs(before: TrackResult, after: TrackResult) -> TrackResult:
    """``after`` with the run ``before`` it, of another model, and what it gains over that."""
    old_N, new_N = before.followed.rms_error_N, after.followed.rms_error_N
    gain = TrackingGain(rms_error_before_N=old_N, rms_error_after_N=new_N, reduction=1 - new_N / old_N)
    return after.model_copy(update={"against": before, "gain": gain})


class Jump(Result):
    """One jump of the reference; shares are of its height, ``error_percent`` of the force given.

    ``error_N`` is the mean and ``largest_error_N`` the largest error over the last half second; ``settling_s`` is None
    where force is not within 2 % of the jump for the last 0.2 s.
    """

    from_N: float
    to_N: float
    actual_N: float
    error_N: float
    error_percent: float
    largest_error_N: float
    overshoot_percent: float
    settling_s: float | None


class WorstJump(Result):
    """The largest of each figure; settling None where any jump did not settle."""

    error_N: float | None
    error_percent: float | None
    largest_error_N: float | None
    overshoot_percent: float | None
    settling_s: float | None


class StudyLevel(Result):
    """One row of the study's table; ``position_error_mm`` is the largest in the last half second."""

    given_N: float
    actual_N: float
    error_N: float
    error_percent: float
    position_error_mm: float


class ComparedRun(Result):
    """All jumps on one subject; ``stopped`` is the sentence of what ended it early, if any."""

    subject: str
    stopped: str
    worst: WorstJump
    jumps: tuple[Jump, ...]
    levels: tuple[StudyLevel, ...]


class AlternativeRun(Result):
    """One law simulated on a subject's tissue as it was learnt, and on tissue half and twice as stiff as that."""

    subject: str
    law: str
    worst: WorstJump
    worst_of_wrong: WorstJump


class CompareResult(SavedResult):
    """Jumps on subjects of the mock bench, with ``models`` learnt of each; ``alternatives`` are simulated beside.

    ``not_simulated`` says of a subject why some or all of its alternatives are lacking.
    """

    reference: str
    models: Mapping[str, Mapping[str, float]]
    runs: tuple[ComparedRun, ...]
    alternatives: tuple[AlternativeRun, ...] = ()
    not_simulated: Mapping[str, str] = {}


class LoopMargins(Result):
    """The force loop at one force: on tissue as it was played, and at its worst over what the model leaves open.

    ``stiffest_N_mm`` is the stiffness at which the loop would begin to oscillate there.
    """

    force_N: float
    tangent_N_mm: float
    crossover_Hz: float
    phase_deg: float
    gain: float
    worst_phase_deg: float
    worst_gain: float
    stiffest_N_mm: float


class LoopReach(Result):
    """What the law can do on this bench: its three numbers, limb motion that is left, and noise in the tissue's force.

    ``left_of_motion`` is the force error of a limb that moves at 1 Hz over that without feedback,
    ``largest_sensitivity`` the worst such ratio of all frequencies and tissues (1 / distance from -1).
    """

    crossover_Hz: float
    lead_ms: float
    drift_Hz: float
    delay_ms: float
    left_of_motion: float
    noise_share: float
    largest_sensitivity: float


class SimulateResult(SavedResult):
    """A reference played on a tissue model."""

    reference: str
    times_real_time: float
    jumps: tuple[Jump, ...]
    duration_s: float
    rms_error_N: float
    peak_force_N: float
    largest_voltage_V: float
    margins: tuple[LoopMargins, ...]
    reach: LoopReach


class Threshold(SavedResult):
    """Where the subject stopped the ramp; ``force_N`` is None where it ended at ``up_to_N`` without a stop."""

    force_N: float | None
    up_to_N: float
    recording: str
    site: str = Field(default="", description="where, if it is not the session's")
