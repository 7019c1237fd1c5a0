"""Live samples of a real run beside the recording of the same run, each read by programs that are not ours."""

import json
import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from api.http.access.scopes import Scope
from mock_devices.testing.access import token
from mock_devices.testing.commands import ServedBench
from mock_devices.testing.service import ServedRig
from tests.api.streams.foreign_client import ForeignClient

# A look at the line takes tens of microseconds, and the next one follows half a cycle later at the soonest.
LOOK_NS = 200_000
SAME_N = 2e-6  # of a 32-bit float
WHOLE = ("force", "position", "depth", "setpoint", "error", "marker", "force.fz_N", "loop.force_N")
PRESS = (
    'kind = "indentation"\nspeeds_mm_s = [30]\ntrials = 1\ndepth_mm = 6\nair_dwell_s = 0.2\napproach_speed_mm_s = 20\n'
    "hold_s = 0.2\nretract_speed_mm_s = 20\nclearance_mm = 4\nforce_limit_N = 12\n[quality]\nrepeats = 0\n"
)


@pytest.fixture
def rig(bench: ServedBench, tmp_path: Path) -> ServedRig:
    (tmp_path / "protocols").mkdir()
    (tmp_path / "protocols" / "press.toml").write_text(PRESS)
    return ServedRig(bench, tmp_path, ["--protocols", "protocols", *bench.settings("stop.port=0", "loop.lease_s=0")])


def rows(recording: Path, topic: str) -> dict[int, Any]:
    """By sequence number, as the stock reader of MCAP and the stock decoder of ROS 2 have them."""
    with recording.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return {row.seq: row for *_, row in reader.iter_decoded_messages(topics=[topic])}


def live(client: ForeignClient, stream: str) -> dict[int, tuple[float, ...]]:
    """By sequence number; only of streams that send every sample."""
    found = client.streams[stream]
    numbers = [seq + k * found.step for seq, count in found.batches for k in range(count)]
    return dict(zip(numbers, found.values, strict=True))


def same(live: Mapping[int, tuple[float, ...]], recorded: Mapping[int, tuple[float, ...]]) -> bool:
    """Whether every recorded sample came live, with the same value to the last bit of a 32-bit float."""
    missing = recorded.keys() - live.keys()
    pairs = np.array([(live[seq], recorded[seq]) for seq in recorded.keys() - missing], np.float32)
    return not missing and len(pairs) > 0 and np.array_equal(pairs[:, 0], pairs[:, 1], equal_nan=True)


def test_live_samples_are_those_of_the_recording(rig: ServedRig) -> None:
    with ForeignClient(rig.port, token(Scope.READ)) as client, ForeignClient(rig.port, token(Scope.READ)) as coarse:
        client.subscribe(*WHOLE)
        coarse.subscribe("force", max_rate_hz=1.0)
        coarse.subscribe("position", max_rate_hz=7.0)
        lease = rig.lease()
        job = rig.ask("POST", "/jobs", {"kind": "capture", "params": {"protocol": "press", "session": "live"}}, lease)[
            "id"
        ]
        until_ended(rig, job, client, coarse)
    recording = rig.folder / "sessions" / "live" / "trial_001.mcap"
    axis, force, loop = (rows(recording, topic) for topic in ("axis", "force", "loop"))
    tip = {seq: row for seq, row in rows(recording, "marker").items() if row.tool == 0}
    assert same(live(client, "position"), {seq: (row.position_mm,) for seq, row in axis.items()})
    assert same(live(client, "force.fz_N"), {seq: (row.fz_n,) for seq, row in force.items()})
    assert same(live(client, "depth"), {seq: (row.depth_mm,) for seq, row in loop.items()})
    assert same(live(client, "setpoint"), {seq: (row.reference_n,) for seq, row in loop.items()})
    assert same(live(client, "error"), {seq: (row.reference_n - row.force_n,) for seq, row in loop.items()})
    assert same(live(client, "marker"), {seq: (row.x_mm, row.y_mm, row.z_mm) for seq, row in tip.items()})
    # Planted: one sample that did not come, and one that is off by its last bits.
    whole = live(client, "position")
    late = {seq: (row.position_mm,) for seq, row in axis.items()}
    inside = sorted(late)[len(late) // 2]
    assert not same({seq: value for seq, value in whole.items() if seq != inside}, late)
    assert not same(whole | {inside: (whole[inside][0] + 1e-4,)}, late)
    shown_N = {seq: value for seq, (value,) in live(client, "force").items()}
    own = own_readings(force, loop)
    assert forces_are_the_loops(shown_N, own)
    middle, _ = own[len(own) // 2]
    # Planted: one reading with another zero, and every reading one place late.
    assert not forces_are_the_loops(shown_N | {middle: shown_N[middle] + 1e-5}, own)
    assert not forces_are_the_loops({seq + 1: value for seq, value in shown_N.items()} | {min(force): 0.0}, own)
    highest_N = max(value for (value,) in live(client, "force").values() if not math.isnan(value))
    assert coarse.streams["force"].highest == highest_N > 1.0
    assert all(found.accounts_for_all() for found in (*client.streams.values(), *coarse.streams.values()))
    events_can_be_asked_for_afterwards(rig)
    the_newest_is_fresh(rig)


def the_newest_is_fresh(rig: ServedRig) -> None:
    for stream in ("force", "position", "depth", "marker"):
        found = rig.ask("GET", f"/streams/{stream}/latest?limit=5")
        assert (found["state"], found["reason"], len(found["samples"])) == ("live", "", 5), stream
        assert 0 <= found["age_s"] < 0.25, stream
        numbers = [one["seq"] for one in found["samples"]]
        assert {after - before for before, after in pairwise(numbers)} == {found["step"]}, stream


def until_ended(rig: ServedRig, job: str, *clients: ForeignClient) -> None:
    """Reads until the job has ended, and then until all of it has come."""
    while rig.ask("GET", f"/jobs/{job}")["state"] == "running":
        for client in clients:
            client.take(10.0)
            while client.took():
                pass
    now_ns = rig.ask("GET", "/info")["monotonic_ns"]
    for client in clients:
        client.until(lambda client=client: client.streams["position"].times_ns[-1:] > [now_ns])
        client.until(lambda client=client: client.streams["force"].times_ns[-1:] > [now_ns])


def own_readings(force: Mapping[int, Any], loop: Mapping[int, Any]) -> list[tuple[int, float]]:
    """The number of each cycle's own reading, and what the loop had as its force then.

    One that came in the look with which a cycle began is its own; of a cycle that was held up nothing is known.
    """
    numbers, arrived_ns = list(force), [row.arrival_ns for row in force.values()]
    found = list[tuple[int, float]]()
    for row in loop.values():
        first, after = (bisect_left(arrived_ns, row.capture_ns + later_ns) for later_ns in (0, LOOK_NS))
        if after == first + 1 and not math.isnan(row.force_n):
            found.append((numbers[first], row.force_n))
    return found


def forces_are_the_loops(shown_N: Mapping[int, float], own: Sequence[tuple[int, float]]) -> bool:
    """Whether each cycle's own reading is what the loop had as its force: its zero was taken off, and no other."""
    return len(own) > 500 and all(abs(shown_N[seq] - force_N) < SAME_N for seq, force_N in own)


def events_can_be_asked_for_afterwards(rig: ServedRig) -> None:
    with ForeignClient(rig.port, token(Scope.READ)) as client:
        client.subscribe(session_id=client.hello["session_id"], since_event=0)
        client.until(lambda: len(client.events) == client.hello["event_seq"])
        codes = [event["code"] for event in client.events]
        assert {"contact", "program_end"} <= set(codes), json.dumps(codes)
