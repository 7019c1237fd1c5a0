"""A threshold by the glove of a bench that runs: out of its ring into a session, and found there by the catalogue."""

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

import pytest

from api.catalogue.folder import read_folder
from api.http.jobs.kinds import GloveThresholdJob
from api.http.jobs.motion import planned
from api.http.jobs.params import GloveThresholdParams
from api.http.jobs.places import Places
from api.operations import glove
from controller.experiments.presses import RULE
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.glove import FingerCalibration, GloveCalibration
from rig.config.products.input_role import brought_by
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, SafetyStop, UsageError
from rig.input_streams import InputSample, input_streams
from rig.recording.reader import read_recording
from rig.recording.ring import RingWriter
from rig.recording.sessions import open_session
from rig.results.catalogue import ThresholdEntry
from rig.results.glove import GloveThreshold

KNOWN = FingerCalibration(loads_N=(0.0, 5.0, 20.0), counts=(0.0, 100.0, 400.0), noise_counts=0.5, repeatability=0.0)
CALIBRATION = GloveCalibration(
    product="firmata-glove", firmware="Std 2.5", date=datetime(2026, 1, 1, tzinfo=UTC), fingers={"thumb": KNOWN}
)
GLOVE = {"product": "firmata-glove", "port": "/dev/glove", "fingers": {"thumb": 0}}
SUBJECT = {"id": "S07", "site": "calf"}
WIRING = Wiring.model_validate({"input": {"glove": GLOVE | {"of_fingers": CALIBRATION}}, "subject": SUBJECT})
PERIOD_NS = 20_000_000


@dataclass
class RingBench:
    """What is asked of a bench that runs."""

    ring_path: Path
    wiring: Wiring = WIRING


@contextmanager
def pressing(folder: Path, *peaks_N: float, wiring: Wiring = WIRING) -> Iterator[Supervisor]:
    """A ring into which somebody's presses come, by the last glove, faster than anybody presses."""
    stream = input_streams(brought_by(wiring.input))[-1]
    ring, ending = RingWriter.create(folder / "loop.ring", 4096), threading.Event()
    rising = [[peak_N * number / 40 for number in range(41)] + [0.0] * 10 for peak_N in peaks_N]
    forces_N = [force_N for press in rising for force_N in press]

    def write() -> None:
        time.sleep(0.2)  # whoever watches begins with what comes from then on
        for seq, force_N in enumerate(forces_N):
            at_ns = PERIOD_NS * seq
            sample = InputSample(seq, at_ns, at_ns + 1, 0, 0, 16_000_000, (force_N, 20 * force_N), 0, 1)
            ring.put(stream.id, stream.pack(sample.row))
        ending.wait(10.0)

    thread = threading.Thread(target=write)
    thread.start()
    yield cast(Supervisor, RingBench(ring.path, wiring))
    ending.set()
    thread.join()
    ring.close()


def test_three_presses_are_kept_with_subject_site_and_recording(tmp_path: Path) -> None:
    folder = tmp_path / "thresholds"
    operation = glove.threshold_operation()
    with pressing(tmp_path, 8.0, 13.0, 8.4, 8.2) as bench:
        found = operation.run(lambda: glove.threshold_beside(operation, bench, "glove", folder))
    assert (found.force_N, found.subject, found.site, found.input, found.rule) == (8.2, "S07", "calf", "glove", RULE)
    assert found.up_to_N == 20.0
    assert [bool(press.refused) for press in found.presses] == [False, True, False, False]
    assert GloveThreshold.read(folder / "glove_001.threshold.json") == found
    recording = read_recording(folder / found.recording)
    assert recording.complete and recording.tables["glove"]["thumb_N"].max() == 13.0
    assert recording.tracks_force  # no fit takes it for an indentation
    (entry,) = [one for one in read_folder(folder) if isinstance(one, ThresholdEntry)]
    assert (entry.subject, entry.site, entry.force_N) == ("S07", "calf", 8.2)
    assert operation.progress.log[1:] == (
        "press 1: 8.0 N",
        "press 2: 13.0 N",
        "press 3: 8.4 N",
        "press 2: 13.0 N, refused: 55% off the median of 8.4 N (at most 25%): repeated",
        "press 4: 8.2 N",
    )


def test_a_second_one_stands_beside_the_first(tmp_path: Path) -> None:
    folder = tmp_path / "thresholds"
    for number in (1, 2):
        (tmp_path / str(number)).mkdir()
        with pressing(tmp_path / str(number), 8.0, 8.4, 8.2) as bench:
            glove.threshold_beside(glove.threshold_operation(), bench, "glove", folder)
    assert [trial.name for trial in open_session(folder).trials] == ["glove_001", "glove_002"]


def test_presses_that_never_agree_are_recorded_and_give_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "thresholds"
    with pressing(tmp_path, *(1.5**number for number in range(2, 11))) as bench, pytest.raises(CheckFailed) as refusal:
        glove.threshold_beside(glove.threshold_operation(), bench, "glove", folder)
    assert "8 presses gave no 3 that agree" in str(refusal.value)
    assert [trial.outcome for trial in open_session(folder).trials] == ["failed"]
    assert not list(folder.glob("*.threshold.json"))


def test_whoever_ends_it_keeps_what_was_recorded(tmp_path: Path) -> None:
    operation = glove.threshold_operation()
    with pressing(tmp_path, 8.0) as bench:
        threading.Timer(1.0, operation.cancel).start()
        with pytest.raises(SafetyStop, match="ended by the operator after 1 presses"):
            glove.threshold_beside(operation, bench, "glove", tmp_path / "thresholds")
    assert len(read_recording(tmp_path / "thresholds" / "glove_001.mcap").tables["glove"]) == 51


@pytest.mark.parametrize(
    ("inputs", "name", "sentence"),
    [
        ({}, "", "0 gloves in the configuration; add"),
        ({"glove": GLOVE}, "", "input.glove: no calibration of thumb; run `rig calibrate glove`"),
        ({"a": GLOVE, "b": GLOVE | {"port": "/dev/b"}}, "", "2 gloves in the configuration"),
        ({"glove": GLOVE}, "other", "input 'other': is no glove; there are: glove"),
        ({"p": {"product": "evdev-switch"}}, "p", "input 'p': is no glove; there are: none"),
    ],
)
def test_what_cannot_be_measured_with_is_refused_before_anybody_presses(
    inputs: dict[str, object], name: str, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError) as refusal:
        glove.check(Wiring.model_validate({"input": inputs}), name, tmp_path / "new")
    assert sentence in str(refusal.value)
    assert not (tmp_path / "new").exists()


def test_the_job_of_the_service_is_checked_and_does_it(tmp_path: Path) -> None:
    places = Places(*(tmp_path / name for name in ("sessions", "protocols", "uploads", "files")))
    body = GloveThresholdJob(kind="threshold-glove", params=GloveThresholdParams(session="found"))
    with pressing(tmp_path, 8.0, 8.4, 8.2) as bench:
        plan = planned(body, bench, places)
        found = plan.work()
    assert isinstance(found, GloveThreshold) and isinstance(plan.operation, Operation)
    assert math.isclose(found.force_N or 0.0, 8.2)
    assert (tmp_path / "sessions" / "found" / "glove_001.threshold.json").exists()


def test_of_two_gloves_the_one_that_was_chosen_is_listened_to(tmp_path: Path) -> None:
    both = {name: GLOVE | {"port": f"/dev/{name}", "of_fingers": CALIBRATION} for name in ("left", "right")}
    wiring = Wiring.model_validate({"input": both, "subject": SUBJECT})
    places = Places(*(tmp_path / name for name in ("sessions", "protocols", "uploads", "files")))
    body = GloveThresholdJob(kind="threshold-glove", params=GloveThresholdParams(session="found", input="right"))
    with pressing(tmp_path, 8.0, 8.4, 8.2, wiring=wiring) as bench:
        found = planned(body, bench, places).work()
    assert isinstance(found, GloveThreshold) and found.input == "right"
    assert math.isclose(found.force_N or 0.0, 8.2)
