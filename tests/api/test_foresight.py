"""What a protocol is expected to do, and what recordings look like, before and after: over the service, no bench."""

import json
import math
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api.http.routes.curves import CurveView
from api.http.service import Service
from mock_devices.testing.access import client_of, in_control
from mock_devices.testing.made.synthetic import Bench, metadata, tables, write_made_session, write_recording
from rig.config.wiring import Wiring
from rig.recording.sessions import open_session, write_session

EXAMPLES = Path(__file__).parents[2] / "examples"
PROTOCOL = "kind = 'indentation'\nspeeds_mm_s = [5, 30]\ntrials = 2\n"
# The example's law by hand: 0.12 x exp(0.22 x) + 0.01 v.
A_N_MM, B_PER_MM, DAMPING = 0.12, 0.22, 0.01


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    protocols, sessions = tmp_path / "protocols", tmp_path / "sessions"
    protocols.mkdir()
    for name, more in (
        ("whole", ""),
        ("short", "depth_mm = 12\n"),
        ("beyond", "depth_mm = 900\n"),
        ("deep", "depth_mm = 10.5\nforce_limit_N = 40\n"),
    ):
        (protocols / f"{name}.toml").write_text(PROTOCOL + more)
    (sessions / "arm" / "fit").mkdir(parents=True)
    (sessions / "arm" / "fit" / "model.json").write_text((EXAMPLES / "forearm-model.json").read_text())
    wiring = Wiring.model_validate({"subject": {"pain_threshold_N": 50}, "limits": {"force_N": 45}})
    with client_of(Service(wiring, sessions, protocols)) as client:
        yield client


def foreseen(client: TestClient, protocol: str, session: str = "arm") -> dict[str, object]:
    answer = client.get(f"/api/v1/protocols/{protocol}/foresight", params={"session": session})
    assert answer.status_code == 200, answer.text
    found: dict[str, object] = answer.json()
    return found


def test_the_force_expected_at_each_speed_is_that_of_the_law_by_hand(client: TestClient) -> None:
    found = foreseen(client, "whole")
    expected = [A_N_MM * 8 * math.exp(B_PER_MM * 8) + DAMPING * speed for speed in (5, 30)]
    assert [one["force_N"] for one in found["expected"]] == pytest.approx(expected)  # type: ignore[attr-defined]
    assert found["verdict"] == "as planned" and "5.9 N at most" in str(found["sentence"])
    assert found["trials"] == 4 and found["doubt"] == ""


def test_where_the_force_limit_comes_first_the_depth_it_comes_at_is_said(client: TestClient) -> None:
    found = foreseen(client, "short")
    assert found["verdict"] == "cut short"
    for one in found["expected"]:  # type: ignore[attr-defined]
        depth_mm, speed = one["depth_mm"], one["speed_mm_s"]
        assert one["ends"] == "force limit" and depth_mm < 12
        force_N = A_N_MM * depth_mm * math.exp(B_PER_MM * depth_mm) + DAMPING * speed
        assert force_N == pytest.approx(12.0, abs=1e-6)


def test_a_subject_that_bears_less_than_the_protocol_presses_is_pressed_less(client: TestClient) -> None:
    wanted = {"id": "S07", "site": "left forearm", "pain_threshold_N": 4.0}
    match = {"If-Match": client.get("/api/v1/subject").headers["ETag"]}
    in_control(client).put("/api/v1/subject", json=wanted, headers=match).raise_for_status()
    found = foreseen(client, "whole")
    assert (found["verdict"], found["force_limit_N"]) == ("cut short", pytest.approx(3.2))
    assert "the force limit of 3.2 N is expected to end 2 of 2 speeds" in str(found["sentence"])


def test_a_refused_protocol_says_so_and_an_unknown_tissue_is_not_guessed(client: TestClient) -> None:
    refused = foreseen(client, "beyond")
    assert refused["verdict"] == "refused" and "900 mm deep" in str(refused["sentence"])
    unknown = foreseen(client, "whole", "")
    assert unknown["verdict"] == "unknown" and unknown["expected"] == []
    assert "12 N ends each compression" in str(unknown["sentence"])


def test_a_depth_beyond_what_the_model_was_fitted_to_is_called_a_guess(client: TestClient) -> None:
    assert "fitted down to 10 mm and 11 N: what it says of 10.5 mm is a guess" in str(foreseen(client, "deep")["doubt"])


def test_what_is_not_there_or_no_model_is_refused_with_a_sentence(client: TestClient) -> None:
    assert client.get("/api/v1/protocols/none/foresight").status_code == 404
    assert client.get("/api/v1/protocols/whole/foresight?session=none").status_code == 404
    assert client.get("/api/v1/protocols/whole/foresight?session=arm&file=../x").status_code == 422
    unfitted = client.get("/api/v1/protocols/whole/foresight?session=arm&file=diagnosis")
    assert unfitted.status_code in (409, 422) and "no such file" in unfitted.json()["detail"]


def test_a_peak_of_one_sample_is_in_the_curve_and_a_recording_that_does_not_open_says_why(
    client: TestClient, tmp_path: Path
) -> None:
    cycle = Bench(noise_N=0.0).cycle(20.0)
    force_N = np.array(cycle.force_N)
    force_N[len(force_N) // 3] = 9.5
    folder = tmp_path / "sessions" / "made"
    write_made_session(folder, [replace(cycle, force_N=force_N), replace(cycle, name="trial_001")])
    (folder / "trial_001.mcap").write_bytes(b"no recording")
    found = client.get("/api/v1/sessions/made/curves").json()
    curve, broken = found["curves"]
    assert max(curve["force_N"]) == pytest.approx(9.5)
    assert len(curve["force_N"]) <= 800 and len(curve["time_s"]) == len(curve["depth_mm"]) == len(curve["force_N"])
    assert curve["speed_mm_s"] == 20.0 and curve["reference_N"] == []
    assert "trial_001.mcap" in broken["problem"] and broken["force_N"] == []
    assert json.dumps(found).find("NaN") == -1


def test_depth_counts_from_the_surface_that_a_fit_finds_and_without_one_the_axis_place_is_drawn(
    client: TestClient, tmp_path: Path
) -> None:
    pressed = Bench().cycle(20.0)  # 8 mm into tissue that begins at 20 mm
    in_air = replace(pressed, name="air", force_N=0.01 * np.random.default_rng(1).standard_normal(len(pressed.force_N)))
    folder = write_made_session(tmp_path / "sessions" / "made", [pressed, in_air])
    for cycle in (pressed, in_air):  # as imported: nobody's loop counted depth
        path = folder / f"{cycle.name}.mcap"
        path.unlink()
        write_recording(path, {name: tables(cycle)[name] for name in ("force", "axis")}, metadata(cycle))
    curve, air = client.get("/api/v1/sessions/made/curves").json()["curves"]
    assert curve["from_surface"] and max(curve["depth_mm"]) == pytest.approx(8.0, abs=0.05)
    assert not air["from_surface"] and max(air["depth_mm"]) == pytest.approx(28.0, abs=0.05)


def test_curves_that_are_asked_for_at_once_are_made_one_after_another(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_made_session(tmp_path / "sessions" / "made", [Bench().cycle(20.0)])
    making, most, answers = list[object](), list[int](), list[int]()

    def slow(*_: object) -> CurveView:
        making.append(None)
        most.append(len(making))
        time.sleep(0.1)
        making.pop()
        return CurveView(name="made")

    def ask() -> None:
        answers.append(client.get("/api/v1/sessions/made/curves").status_code)

    monkeypatch.setattr("api.http.routes.curves._curve", slow)
    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert answers == [200] * 4 and most == [1] * 4


def test_more_recordings_than_can_be_drawn_are_counted(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "sessions" / "many"
    write_made_session(folder, [Bench().cycle(20.0)])
    session = open_session(folder)
    write_session(folder, replace(session.info, trials=session.info.trials * 3))
    monkeypatch.setattr("api.http.routes.curves.MOST_CURVES", 2)
    found = client.get("/api/v1/sessions/many/curves").json()
    assert (len(found["curves"]), found["left_out"]) == (2, 1)
    assert client.get("/api/v1/sessions/none/curves").status_code == 404
