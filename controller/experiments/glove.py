"""The subject's pain threshold at a site by a glove: recorded, judged press by press, kept with subject and site."""

import json
import math
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.experiments.capture import new_session
from controller.experiments.presses import MOST, PRESSES, RULE, GlovePress, gathered, threshold_N
from controller.experiments.recorded import stated
from controller.inputs.watch import Row
from controller.operation import Operation
from rig.channels import Stream
from rig.config.products.firmata_glove import FirmataGlove
from rig.config.products.input_role import brought_by
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, SafetyStop, UsageError
from rig.input_streams import input_streams
from rig.recording.mcap_file import RecordingWriter
from rig.recording.reader import TRACKING
from rig.recording.sessions import SESSION_FILE, TrialInfo, open_session, write_session
from rig.results.glove import GloveThreshold, PressSeen
from rig.results.tracking import THRESHOLD


def glove_of(wiring: Wiring, name: str) -> tuple[str, FirmataGlove]:
    """The glove called ``name``, or the only one; raises UsageError where it is none, or has no calibration."""
    gloves = {each: product for each, product in wiring.input.items() if isinstance(product, FirmataGlove)}
    if name and name not in gloves:
        raise UsageError(f"input {name!r}: is no glove; there are: {', '.join(gloves) or 'none'}")
    if not name and len(gloves) != 1:
        raise UsageError(f"{len(gloves)} gloves in the configuration; add [input.glove], or name one with --input")
    found = name or next(iter(gloves))
    return found, gloves[found]


def refuse_uncalibrated(name: str, glove: FirmataGlove) -> None:
    """Raises UsageError where a finger's force is not known."""
    known = glove.of_fingers.fingers if glove.of_fingers else {}
    missing = [finger for finger in glove.fingers if finger not in known]
    if missing:
        raise UsageError(
            f"input.{name}: no calibration of {', '.join(missing)}; run `rig calibrate glove` and name its file as"
            f" input.{name}.calibration"
        )


def stream_of(wiring: Wiring, name: str) -> Stream:
    """The stream of input ``name``."""
    return next(stream for stream in input_streams(brought_by(wiring.input)) if stream.name == name)


def total_N(stream: Stream, glove: FirmataGlove, row: Row) -> float | None:
    """Force of the whole hand; None where that of a finger is not known."""
    values = dict(zip(stream.kinds, row, strict=True))
    force_N = sum(values[f"{finger}_N"] for finger in glove.fingers)
    return force_N if math.isfinite(force_N) else None


def record(rows: Sequence[Row], wiring: Wiring, name: str, folder: Path, outcome: str) -> Path:
    """The glove's rows as a recording of the session in ``folder``, a new one where there is none; its file."""
    if not (folder / SESSION_FILE).exists():
        new_session(folder, "track", {"name": "glove", "kind": TRACKING}, wiring)
    file, stream = folder / f"{_free_name(folder)}.mcap", stream_of(wiring, name)
    info, samples = open_session(folder).info, {stream.name: len(rows)}
    about = stated(wiring, info.id, file.stem) | {"trial": {"kind": TRACKING, "name": "threshold by glove"}}
    with closing(RecordingWriter(file, about)) as writer:
        writer.add_rows(stream, np.array(rows, stream.dtype))
        writer.finish({"outcome": outcome, "samples": json.dumps(samples), "dropped": "{}"})
    entry = TrialInfo(file.stem, file.name, speed_mm_s=math.nan, depth_mm=math.nan, outcome=outcome, samples=samples)
    write_session(folder, replace(info, trials=(*info.trials, entry.sealed(folder))))
    return file


def _free_name(folder: Path) -> str:
    number = 1
    while (folder / f"glove_{number:03d}.mcap").exists():
        number += 1
    return f"glove_{number:03d}"


def find(operation: Operation, wiring: Wiring, name: str, rows: Iterable[Row]) -> tuple[GlovePress, ...]:
    """Presses until three count; CheckFailed where too many do not, SafetyStop where the operator ended it."""
    glove, stream = glove_of(wiring, name)[1], stream_of(wiring, name)
    presses: tuple[GlovePress, ...] = ()
    operation.say(f"on {wiring.subject.site}, {PRESSES} times: press slowly until the subject says stop, then let go")
    for found in gathered((int(row[1]), total_N(stream, glove, row)) for row in rows):
        operation.advance(sum(not press.refused for press in found), f"{found[-1].peak_N:.1f} N")
        changed = [number for number, press in enumerate(found) if press not in presses[number : number + 1]]
        operation.say(*(_sentence(number + 1, found[number]) for number in reversed(changed)))
        presses = found
    if threshold_N(presses) is not None:
        return presses
    if len(presses) < MOST:
        raise SafetyStop(f"ended by the operator after {len(presses)} presses: no threshold was found")
    refused = "; ".join(press.refused for press in presses if press.refused)
    raise CheckFailed(f"{len(presses)} presses gave no {PRESSES} that agree: {refused}; rest, then try again")


def _sentence(number: int, press: GlovePress) -> str:
    return f"press {number}: {press.peak_N:.1f} N" + (f", refused: {press.refused}" if press.refused else "")


def keep(presses: Sequence[GlovePress], wiring: Wiring, name: str, file: Path) -> GloveThreshold:
    """The result, written beside its recording ``file``."""
    known = glove_of(wiring, name)[1].of_fingers
    assert known, "without a calibration no press is found"
    found = GloveThreshold(
        force_N=threshold_N(presses),
        up_to_N=sum(finger.loads_N[-1] for finger in known.fingers.values()),
        recording=file.name,
        subject=wiring.subject.id,
        site=wiring.subject.site,
        input=name,
        presses=tuple(PressSeen.model_validate(press) for press in presses),
        rule=RULE,
    )
    found.write(file.with_suffix(f".{THRESHOLD}"))
    return found
