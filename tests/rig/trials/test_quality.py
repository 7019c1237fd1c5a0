"""The verdict on a trial: good where nothing is planted, and every fault that is planted is named with its number."""

import json
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import Bench
from rig.config.quality import Bounds, QualityLimits
from rig.recording.sessions import TrialInfo
from rig.trials.quality import TrialQuality, evaluate_trial, quality_of
from tests.rig.trials.made import HOLD_STEP, Tables, incomplete, trial

LIMITS = QualityLimits()


def evaluated(plant: Callable[[Tables], None]) -> TrialQuality:
    return evaluate_trial(trial(plant), LIMITS)


@pytest.mark.parametrize("speed_mm_s", [5.0, 30.0])
def test_a_quiet_trial_is_good_and_says_what_was_measured(speed_mm_s: float) -> None:
    found = evaluate_trial(trial(speed_mm_s=speed_mm_s), LIMITS)
    assert (found.verdict, found.reasons) == ("good", ())
    measured = found.measured
    assert measured["force.rate_lost"] < 0.001 and measured["cycles_missed"] == 0.0
    assert measured["contact_within_mm"] == pytest.approx(0.03)
    assert measured["depth_off_mm"] < 0.1 and measured["loading_lost"] < 0.1
    assert measured["zero_drift_N"] < 0.01 and measured["tracker_slope_off"] < 0.005


def without(table: str, gone: Callable[[np.ndarray], np.ndarray]) -> Callable[[Tables], None]:
    """Leaves out rows of a stream, by a mask of their numbers."""

    def plant(made: Tables) -> None:
        made[table] = made[table][~gone(np.arange(len(made[table])))]

    return plant


def changed(table: str, field: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Tables], None]:
    """Changes one column of a stream."""

    def plant(made: Tables) -> None:
        made[table][field] = change(made[table][field])

    return plant


def loop_at_850_Hz(made: Tables) -> None:
    """As in the finding: 15 % of the cycles are missed, and the axis is not asked in them."""
    for stream in ("loop", "axis"):
        without(stream, lambda row: row % 20 < 3)(made)


def frozen(made: Tables) -> None:
    for name in ("fx_N", "fy_N", "fz_N", "mx_N_m", "my_N_m", "mz_N_m"):
        made["force"][name][200:260] = made["force"][name][200]


def drifting(made: Tables) -> None:
    made["force"]["fz_N"][made["loop"]["step"] > HOLD_STEP] -= 0.3


def clipped(made: Tables) -> None:
    made["force"]["fz_N"] = np.maximum(made["force"]["fz_N"], -3.0)


def shallow(made: Tables) -> None:
    made["axis"]["position_mm"] = np.minimum(made["axis"]["position_mm"], 27.2)


def jumping(made: Tables) -> None:
    made["marker"]["x_mm"][100] += 5.0


def invalid(made: Tables) -> None:
    made["force"]["valid"][::50] = 0


def tip_hidden(made: Tables) -> None:
    made["marker"]["valid"][::4] = 0


@pytest.mark.parametrize(
    ("plant", "verdict", "reason"),
    [
        (loop_at_850_Hz, "usable", r"the loop missed of its cycles 1[45][.\d]* % \(good up to 5 %\)"),
        (without("axis", lambda row: row % 20 < 3), "usable", r"axis: below its nominal rate by 1[45][.\d]* %"),
        (without("loop", lambda row: row % 5 < 2), "bad", r"the loop missed of its cycles 40 %"),
        (without("force", lambda row: row % 100 == 7), "usable", r"force: samples lost or invalid 1 %"),
        (without("force", lambda row: row % 10 < 1), "bad", r"force: samples lost or invalid 10 %"),
        (invalid, "usable", r"lost or invalid 2[.\d]* %"),
        (without("force", lambda row: (row > 900) & (row < 960)), "usable", r"force: a gap of 58 ms \(good up to 20"),
        (without("axis", lambda row: (row > 900) & (row < 960)), "usable", r"axis: a gap of 58 ms"),
        (clipped, "bad", r"force: samples at the end of the range \d+"),
        (frozen, "usable", r"force: equal readings in a row, as of a frozen sensor: 59"),
        (changed("force", "fx_N", np.zeros_like), "usable", r"channels that never change \(fx_N\): 1"),
        (drifting, "usable", r"force in the air went off during the trial by 0\.[23]\d* N"),
        (tip_hidden, "usable", r"frames of the tip lost 2[4-6]"),
        (without("marker", lambda row: row % 2 == 0), "usable", r"tracker: frames of the tip lost (49|50|51)"),
        (jumping, "usable", r"tracker: the tip's marker jumps by (5|4\.9)[.\d]* mm \(good up to 1 mm\)"),
        (changed("marker", "z_mm", lambda z: 1.1 * z), "usable", r"travels 1\.09\d* mm while the axis says 1 mm"),
        (changed("axis", "position_mm", lambda p: 20 + 2 * (p - 20)), "bad", r"tracker: travels 0\.(5|49)\d* mm while"),
        (shallow, "usable", r"depth reached 7\.(19|2\d?) of 8 mm: off by 0\.[678]"),
    ],
)  # fmt: skip
def test_what_is_planted_is_named_with_its_number(plant: Callable[[Tables], None], verdict: str, reason: str) -> None:
    found = evaluated(plant)
    assert found.verdict == verdict, found.reasons
    assert any(re.search(reason, said) for said in found.reasons), found.reasons


def test_a_loading_that_the_limit_of_force_ended_may_be_less_deep_and_not_deeper() -> None:
    made = trial()
    shallow(made.tables)
    made.metadata["summary"]["outcome"] = "force limit"
    assert not [reason for reason in evaluate_trial(made, LIMITS).reasons if "depth" in reason]
    made.metadata["trial"]["depth_mm"] = "6.0"
    assert [reason for reason in evaluate_trial(made, LIMITS).reasons if re.search(r"depth reached 7\.(19|2)", reason)]


def test_a_noisy_wire_is_said_though_nothing_is_lost() -> None:
    made = trial()
    made.metadata["summary"]["wire_damage"] = json.dumps({"force": 0.4, "axis": 0.002})
    found = evaluate_trial(made, LIMITS)
    assert found.verdict == "usable"
    assert found.reasons == ("force: damaged or foreign on its wire, bytes a message: 0.4 (good up to 0.002)",)


def test_a_surface_that_is_known_badly_is_said() -> None:
    wide = json.dumps({"surface_mm": 20.0, "low_mm": 19.5, "high_mm": 20.1})
    found = evaluate_trial(trial(contact=wide), LIMITS)
    assert found.verdict == "usable"
    assert found.reasons == ("the surface is known no better than +- 0.5 mm (good up to 0.2 mm)",)
    assert evaluate_trial(trial(contact=wide.replace("19.5", "16")), LIMITS).verdict == "bad"


def test_a_loading_of_which_a_fit_can_use_less_than_half_is_bad() -> None:
    """The finding: 3.2 of 8 mm were used, and nothing said so."""
    cycle = Bench()
    made = trial(bench=cycle)
    axis = made.tables["axis"]
    moving = np.flatnonzero(made.tables["loop"]["step"] == 3)
    late = moving[len(moving) // 3 :]
    axis["position_mm"][late] = axis["position_mm"][late[0]]
    found = evaluate_trial(made, LIMITS)
    assert found.verdict == "bad"
    assert any("loading no fit can use" in reason for reason in found.reasons), found.reasons


@pytest.mark.parametrize(
    ("spoilt", "reason"),
    [
        (incomplete(trial()), "the recording was not finished"),
        (trial(cause="force limit"), "it was stopped: force limit"),
        (replace(trial(), damage=("chunk 3 is damaged",)), "the recording is damaged: chunk 3 is damaged"),
        (trial(changed("force", "fz_N", lambda fz: np.round(0.001 * fz, 3))), "no loading can be read .*no contact"),
    ],
)  # fmt: skip
def test_what_was_stopped_or_has_no_loading_is_bad_whatever_else_holds(spoilt: object, reason: str) -> None:
    found = evaluate_trial(spoilt, LIMITS)  # type: ignore[arg-type]
    assert found.verdict == "bad"
    assert any(re.search(reason, said) for said in found.reasons), found.reasons


def test_each_bound_is_what_decides() -> None:
    """With a bound out of the way, the fault that only it notices leaves the trial good."""
    for name, plant in {
        "cycles_missed": without("loop", lambda row: row % 20 < 3), "frozen_samples": frozen, "zero_drift_N": drifting,
        "dead_channels": changed("force", "fx_N", np.zeros_like), "tracker_jump_mm": jumping,
        "gap_ms": without("axis", lambda row: (row > 900) & (row < 960)),
    }.items():  # fmt: skip
        assert evaluated(plant).verdict == "usable", name
        lenient = LIMITS.model_copy(update={name: Bounds(good=1e6)})
        assert evaluate_trial(trial(plant), lenient).verdict == "good", name


def test_a_run_of_force_is_judged_by_its_streams_alone() -> None:
    made = trial(loop_at_850_Hz)
    tracked = replace(made, metadata=made.metadata | {"trial": {"kind": "tracking"}})
    found = evaluate_trial(tracked, LIMITS)
    assert found.verdict == "usable"
    assert "loading_lost" not in found.measured and "contact_within_mm" not in found.measured
    pained = replace(tracked, metadata=tracked.metadata | {"summary": {"outcome": "pain_stop", "cause": "pain"}})
    assert evaluate_trial(pained, LIMITS).verdict == "usable"


def test_the_session_decides_where_it_says_and_the_recording_where_it_does_not() -> None:
    made = trial(loop_at_850_Hz)
    silent = TrialInfo("trial_001", "trial_001.mcap", 10.0, 8.0, "complete")
    from_recording = quality_of(made, silent)
    assert from_recording and from_recording.verdict == "usable"
    stated = replace(silent, quality="bad", reasons=("it says so",))
    said = quality_of(made, stated)
    assert said == TrialQuality("bad", ("it says so",), {}) and said.sentence == "quality bad, left out: it says so"
    foreign = replace(made, metadata={name: made.metadata[name] for name in ("trial", "calibration")})
    assert quality_of(foreign, silent) is None


@pytest.mark.parametrize(("gain", "verdict"), [(0.5, "usable"), (1.0, "good"), (1.15, "good"), (2.0, "usable")])
def test_another_gain_than_in_the_trials_before_is_visible(gain: float, verdict: str) -> None:
    found = evaluate_trial(trial(peak_force_N=repr(5.6 * gain)), LIMITS, (5.5, 5.6, 5.9))
    assert found.verdict == verdict
    if verdict != "good":
        said = f"peak force {5.6 * gain:.2f} N, 5.60 N in the trials before (another gain, or another site?): off by"
        assert found.reasons[0].startswith(said)
    assert evaluate_trial(trial(peak_force_N="2.0", outcome="force limit"), LIMITS, (5.5,)).verdict == "good"


def test_a_bad_bound_below_the_good_one_is_refused() -> None:
    with pytest.raises(ValueError, match=r"bad 0\.1 is below good 0\.5"):
        Bounds(good=0.5, bad=0.1)
