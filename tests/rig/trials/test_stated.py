"""Speed, depth and surface that somebody states, against the motion: both numbers where they differ, else silence."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import Bench
from mock_devices.testing.real_data import ROOT
from rig.config.table import load
from rig.intake.mapping import DataMapping, RecordingFacts
from rig.trials.opening import import_files
from rig.trials.reading import trials_of
from rig.trials.stated import stated_findings
from rig.trials.trial import Trial
from tests.data import recording
from tests.rig.recording.measured import NOW

SPEED_MM_S, DEPTH_MM, SURFACE_MM = 10.0, 8.0, 20.0


def pressed(rate_Hz: float = 1000.0, air: bool = True, speed_mm_s: float = SPEED_MM_S) -> Trial:
    """Approach at 5 mm/s, back off, 8 mm deep, hold, retraction; without ``air`` from the start of the loading on."""
    cycle = Bench(rate_Hz=rate_Hz, axis_rate_Hz=rate_Hz).cycle(speed_mm_s, seed=4)
    first = 0 if air else int(np.argmax(cycle.position_mm > 20.5))
    time_s, force_N, position_mm = (x[first:] for x in (cycle.time_s, cycle.force_N, cycle.position_mm))
    return Trial("one", time_s, force_N, time_s, position_mm, None, None, None, speed_mm_s, DEPTH_MM, SURFACE_MM)


def pulled() -> Trial:
    """A strip: force and position count downwards from a clamp."""
    time_s = np.arange(0.0, 20.0, 0.1)
    way_mm = np.minimum(time_s, 12.0) * 0.5
    return Trial("strip", time_s, -0.3 * way_mm, time_s, -way_mm, None, None, None, 0.5, 6.0)


def stepping(rest_s: float = 0.9) -> Trial:
    """At 10 Hz, ten steps of 0.5 mm in a tenth of a second, with rests between."""
    gone_mm = np.tile([0.5, *np.zeros(round(rest_s / 0.1))], 10)
    way_mm = np.concatenate([np.zeros(5), np.cumsum(gone_mm), np.full(5, 5.0)]).astype(np.float64)
    time_s = np.arange(len(way_mm)) * np.float64(0.1)
    return Trial("steps", time_s, 0.2 * way_mm**1.5, time_s, way_mm, None, None, None, 5.0, 5.0)


def kinds(trial: Trial) -> list[str]:
    return [finding.kind for finding in stated_findings(trial)]


@pytest.mark.parametrize("speed_mm_s", [1.0, 5.0, 30.0])
@pytest.mark.parametrize("air", [True, False])
@pytest.mark.parametrize("rate_Hz", [1000.0, 50.0])
def test_what_is_the_motions_is_no_finding(speed_mm_s: float, air: bool, rate_Hz: float) -> None:
    assert kinds(pressed(rate_Hz, air, speed_mm_s)) == []


def test_at_10_Hz_on_strips_and_in_steps_neither() -> None:
    assert kinds(pressed(10.0)) == kinds(pressed(10.0, speed_mm_s=30.0)) == kinds(pulled()) == kinds(stepping()) == []
    # The pace of a motion that steps is its speed as well as that of its steps.
    assert kinds(replace(stepping(), speed_mm_s=0.5)) == []


def test_nothing_stated_or_too_few_samples_say_nothing() -> None:
    trial = pressed()
    nothing = replace(trial, speed_mm_s=np.nan, depth_mm=np.nan, surface_mm=np.nan)
    assert kinds(nothing) == kinds(replace(nothing, axis_mm=0 * trial.axis_mm)) == []
    assert kinds(replace(trial, force_s=trial.force_s[:5], force_N=trial.force_N[:5])) == []


@pytest.mark.parametrize("factor", [10.0, 0.1])
@pytest.mark.parametrize("trial", [pressed(), pressed(10.0), pressed(air=False), pulled(), stepping()])
def test_a_speed_ten_times_wrong_is_said_with_both_numbers(trial: Trial, factor: float) -> None:
    stated_mm_s = trial.speed_mm_s * factor if factor > 1 else 0.05 * trial.speed_mm_s
    (found,) = stated_findings(replace(trial, speed_mm_s=stated_mm_s))
    own = "0.5 mm/s (in steps at up to 5)" if trial.name == "steps" else f"{trial.speed_mm_s:.2g} mm/s"
    assert found.kind == "speed"
    assert found.text == f"stated speed {stated_mm_s:.3g} mm/s, but the tip loads at {own}: the motion's is used"


@pytest.mark.parametrize(("depth_mm", "says"), [(8000.0, "goes 13"), (0.008, "force rises over 5.6"), (0.315, "rises")])
def test_a_depth_in_another_unit_is_said_with_both_numbers(depth_mm: float, says: str) -> None:
    (found,) = stated_findings(replace(pressed(), depth_mm=depth_mm))
    assert found.kind == "depth"
    assert found.text.startswith(f"stated depth {depth_mm:.3g} mm, but ") and says in found.text


@pytest.mark.parametrize("surface_mm", [-20.0, 200.0, 0.02, 26.0])
def test_a_surface_where_the_tip_does_not_go_is_said(surface_mm: float) -> None:
    (found,) = stated_findings(replace(pressed(), surface_mm=surface_mm))
    assert found.kind == "surface"
    assert f"stated surface {surface_mm:.4g} mm, but the tip goes from 15 to 28 mm" in found.text


@pytest.mark.parametrize("factor", [1e-3, 0.1, 25.4, 1000.0])
def test_a_position_in_another_unit_is_bad(factor: float) -> None:
    trial = pressed()
    found = stated_findings(replace(trial, axis_mm=factor * trial.axis_mm, surface_mm=np.nan))
    assert [finding.kind for finding in found] == ["speed", "depth", "quality_bad"]
    assert f"off by a factor of about {1 / factor:.2g}: position is in another unit" in found[2].text
    alone = replace(trial, speed_mm_s=1000.0, depth_mm=0.008)
    assert kinds(alone) == ["speed", "depth"]  # which unit would make both right?


def test_a_tip_that_stands_still_goes_no_depth() -> None:
    trial = pressed()
    still = replace(trial, axis_mm=np.full_like(trial.axis_mm, 20.0), surface_mm=np.nan)
    assert [finding.text for finding in stated_findings(still)] == ["stated depth 8 mm, but the tip goes 0 mm in all"]


@pytest.mark.parametrize(
    ("rate_factor", "length_mm", "said"), [(1, 80.0, []), (10, 80.0, ["speed"]), (1, 8.0, ["bad"])]
)
def test_strips_of_elastomer_move_as_their_names_say(
    rate_factor: float, length_mm: float, said: list[str], tmp_path: Path
) -> None:
    """Strips of 80 mm: 0d05_2d5 is strained at 0.05 1/s to 2.5 times its length. A length of 8 mm makes both wrong."""
    source, mapping = recording("vhb4910"), load(DataMapping, ROOT / "examples" / "mappings" / "vhb4910.toml")
    facts = {}
    for path in source.glob("0d05_*.csv"):
        rate, stretch = (float(part.replace("d", ".")) for part in path.stem.split("_")[:2])
        speed_mm_s, depth_mm = rate_factor * rate * length_mm, (stretch - 1) * length_mm
        facts[path.stem] = RecordingFacts(speed_mm_s=speed_mm_s, depth_mm=depth_mm)
    tables = (mapping.tables[0].model_copy(update={"files": "0d05_*.csv"}),)
    stated = mapping.model_copy(update={"recordings": facts, "tables": tables})
    session = import_files(source, stated, tmp_path / "out", NOW)
    assert {trial.quality for trial in session.trials} == {"bad" if said == ["bad"] else "usable" if said else ""}
    found = [one for one in trials_of(session).findings if one.recording and one.stream != "session"]
    assert [one.kind.removeprefix("quality_") for one in found] == said * 5
    assert len(trials_of(session).trials) == (0 if said == ["bad"] else 5)
