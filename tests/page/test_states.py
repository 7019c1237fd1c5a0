"""What each view says in states of its own; the states that all share are in `test_every_view`."""

import contextlib
import json
import math
import re
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.access.models import AuditView
from api.http.models import RigView
from mock_devices.testing import commands
from mock_devices.testing.commands import ServedBench
from tests.page import steps, told, told_lab
from tests.page.looks import holds_up, violations
from tests.page.pretend import ADMINISTRATOR, IDLE, STOPPED, Pretended, opened, resting
from tests.page.steps import out_or_named, state
from tests.page.told_lab import AUDIT

VIEWS = {"run": "run", "session": f"session/{told.NAME}", "track": "track", "bench": "bench", "devices": "devices",
         "admin": "admin"}  # fmt: skip
LEASE = {"lease_id": "l", "epoch": 1, "expires": told.AT}
IN_CONTROL = {"POST control/lease": LEASE, "PUT control/lease": LEASE}
TOO_MUCH = "40 N is more than the 6 N that bench, subject and model allow."


@pytest.fixture
def service() -> Pretended:
    return resting(**{"POST estop": STOPPED})


@pytest.fixture
def errors() -> Iterator[list[str]]:
    found: list[str] = []
    yield found
    assert found == []


@pytest.fixture
def show(browser: Browser, service: Pretended, errors: list[str]) -> Iterator[Any]:
    pages: list[Page] = []

    def at(view: str) -> Page:
        pages.append(opened(browser, service, VIEWS[view], errors))
        return pages[-1]

    yield at
    for page in pages:
        page.context.close()


def test_a_state_that_does_not_come_is_told_with_the_reason_of_the_one_there_is(show: Any, service: Pretended) -> None:
    service.says(rig=IDLE.model_copy(update={"state": "stopped", "reason": "the drive reports: 8130 heartbeat"}))
    page = show("bench")
    state(page, "stopped")
    with pytest.raises(AssertionError) as failed:
        state(page, "ready", 300.0)
    (said,) = failed.value.__notes__
    assert '"reason": "the drive reports: 8130 heartbeat"' in said and '"mode": "idle"' in said


@pytest.mark.bench  # at the lower priority of the others its news once came half a second late
def test_a_bench_that_is_not_ready_is_not_taken_for_one_that_is(show: Any, service: Pretended) -> None:
    service.says(rig=IDLE.model_copy(update={"state": "not ready", "reason": "force is connecting: it starts"}))
    page = show("bench")
    state(page, "not ready")
    with pytest.raises(AssertionError, match="Actual value: not ready"):
        state(page, "ready", 300.0)


@pytest.mark.parametrize(
    ("kind", "request_"),
    [
        ("calibrate-force", "put 1 N on the tip, alone"),
        ("calibrate-glove", "put 1 N on finger 2, alone"),
        ("calibrate-axis", "see that the tip's way is free from home to 14 mm, and the limb out"),
    ],
)
def test_a_calibration_shows_what_it_asks_for_and_goes_on_once_a_person_says_so(
    show: Any, service: Pretended, kind: str, request_: str
) -> None:
    asks = {"message": request_, "can": ["cancel", "resume"], "session": None}
    under_way = told.job(kind, "paused", **asks)
    service.answers |= listed(under_way) | IN_CONTROL
    service.answers |= {f"POST jobs/job-{kind}/resume": under_way}
    page = show("devices")
    expect(page.locator(f"#{kind}-asks")).to_have_text(request_)
    holds_up(page, f"state-{kind}-devices", (390,))
    with page.expect_request(f"**/jobs/job-{kind}/resume") as asked:
        page.click(f"#{kind}-resume")
    assert asked.value.headers["x-control-lease"] == "l"


def test_a_double_click_answers_one_request(show: Any, service: Pretended) -> None:
    asks = {"message": "put 1 N on the tip, alone", "can": ["cancel", "resume"], "session": None}
    paused = told.job("calibrate-force", "paused", **asks)
    service.answers |= listed(paused) | IN_CONTROL | {"POST jobs/job-calibrate-force/resume": paused}
    page = show("devices")
    with page.expect_response("**/jobs/job-calibrate-force/resume"):
        page.dblclick("#calibrate-force-resume")
    expect(page.locator("#calibrate-force-cancel")).to_be_enabled()
    expect(page.locator("#calibrate-force-resume")).to_be_enabled()
    assert [path for _, path, _ in service.asked if path.endswith("resume")] == ["jobs/job-calibrate-force/resume"]


def test_more_of_a_list_is_shown_once_it_is_asked_for(show: Any, service: Pretended) -> None:
    line = AUDIT.items[0]
    newest = [line.model_copy(update={"seq": seq}) for seq in range(205, 5, -1)]
    older = [line.model_copy(update={"seq": seq}) for seq in range(5, 0, -1)]
    service.answers |= told_lab.around() | {"auth/me": ADMINISTRATOR}
    service.answers |= {"audit": AuditView(items=newest, next="c1", broken=[])}
    service.answers |= {"audit@c1": AuditView(items=older, next=None, broken=[])}
    page = show("admin")
    expect(page.locator("#audit tr")).to_have_count(200)
    page.click("text=Show more")
    expect(page.locator("#audit tr")).to_have_count(205)
    expect(page.get_by_text("Show more")).to_have_count(0)


def starts(service: Pretended, kind: str) -> None:
    """What is asked to start does."""
    begun = told.job(kind, "running", session=None)
    service.answers |= IN_CONTROL | {"POST jobs": begun}
    service.answers |= {f"jobs/{begun['id']}": begun}


def asked_by(page: Page, button: str) -> Any:
    """The job that pressing ``button`` asks for."""
    with page.expect_request(lambda sent: sent.method == "POST" and sent.url.endswith("/jobs")) as asked:
        page.click(button)
    return asked.value.post_data_json


def test_a_gauge_block_is_asked_for_with_its_height_and_place(show: Any, service: Pretended) -> None:
    starts(service, "calibrate-axis")
    service.says(rig=IDLE)
    page = show("devices")
    page.select_option("#against", "block")
    page.fill("#block-height", "10.003")
    page.click("#calibrate-axis")
    expect(page.locator("#block-near:invalid")).to_be_visible()
    page.fill("#block-near", "31.5")
    holds_up(page, "state-calibrate-axis-block", (390,))
    assert asked_by(page, "#calibrate-axis") == {
        "kind": "calibrate-axis",
        "params": {"gauge_block_mm": 10.003, "near_mm": 31.5},
    }


def with_gloves(*names: str) -> RigView:
    """A bench that has them."""
    worn = {name: IDLE.devices["force"] | {"product": "firmata-glove"} for name in names}
    pedal = {"pedal": IDLE.devices["force"] | {"product": "evdev-switch"}}
    return IDLE.model_copy(update={"devices": IDLE.devices | worn | pedal})


GLOVE_WORK = {"threshold-glove": ("run", "#glove-start"), "calibrate-glove": ("devices", "#calibrate-glove")}
CHOICE = {"threshold-glove": "#glove-input", "calibrate-glove": "#calibrate-glove-input"}


def ready_for(page: Page, kind: str) -> None:
    """Fills in what else that work asks for."""
    if kind == "calibrate-glove":
        page.fill("#glove-weights", "1 N, 2 N")
    else:
        page.click("#glove summary")


@pytest.mark.parametrize("kind", GLOVE_WORK)
def test_of_several_gloves_a_person_chooses_one_and_none_is_taken_unasked(
    show: Any, service: Pretended, kind: str
) -> None:
    view, button = GLOVE_WORK[kind]
    choice = CHOICE[kind]
    starts(service, kind)
    service.says(rig=with_gloves("left", "right"))
    page = show(view)
    ready_for(page, kind)
    expect(page.locator(button)).to_be_disabled()
    expect(page.locator(f"{button}-why")).to_have_text("The bench has several gloves: choose one.")
    expect(page.locator(f"{choice} option")).to_have_text(["choose a glove", "left", "right"])
    page.select_option(choice, "right")
    holds_up(page, f"state-gloves-{view}", (390,))
    asked = asked_by(page, button)
    assert (asked["kind"], asked["params"]["input"]) == (kind, "right")


@pytest.mark.parametrize("kind", GLOVE_WORK)
def test_the_only_glove_is_not_asked_for(show: Any, service: Pretended, kind: str) -> None:
    view, button = GLOVE_WORK[kind]
    starts(service, kind)
    service.says(rig=with_gloves("left"))
    page = show(view)
    ready_for(page, kind)
    expect(page.locator(button)).to_be_enabled()
    expect(page.locator(CHOICE[kind])).to_have_count(0)
    assert "input" not in asked_by(page, button)["params"]


def test_a_glove_that_is_gone_since_it_was_chosen_is_not_asked_for(show: Any, service: Pretended) -> None:
    service.says(rig=with_gloves("left", "middle", "right"))
    page = show("run")
    page.click("#glove summary")
    page.select_option("#glove-input", "right")
    expect(page.locator("#glove-start")).to_be_enabled()
    service.says(rig=with_gloves("left", "middle"))
    expect(page.locator("#glove-start")).to_be_disabled()
    expect(page.locator("#glove-input")).to_have_value("")


@pytest.mark.parametrize(
    ("reason", "named"),
    [
        ("axis lost: newest sample is 1200 ms old (limit 1000 ms)", True),
        ("whoever started this is not in control any more: control was given back or ran out", False),
        ("", False),
    ],
)
def test_a_tip_that_a_takeover_leaves_in_the_tissue_needs_a_reason_that_left_it_there(
    show: Any, service: Pretended, reason: str, named: bool
) -> None:
    service.says(rig=IDLE.model_copy(update={"state": "stopped", "mode": "safe", "reason": reason}))
    pressing = cast(ServedBench, SimpleNamespace(control=SimpleNamespace(number=lambda _: 1.0)))
    page = show("bench")
    with contextlib.nullcontext() if named else pytest.raises(AssertionError):
        out_or_named(page, pressing)


def test_a_tip_that_stays_in_is_told_with_what_the_service_says_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    pressing = cast(ServedBench, SimpleNamespace(control=SimpleNamespace(number=lambda _: 1.0)))
    says = {"state": "stopped", "reason": "the axis goes on reporting 25.983 mm", "since": "now"}
    monkeypatch.setattr(steps, "ask", lambda *asked: says if asked == ("http://here", "GET", "/rig") else {})
    monkeypatch.setattr(commands, "PATIENCE_S", 0.05)
    with pytest.raises(AssertionError, match="the tip out of contact") as failed:
        steps.out(pressing, "http://here")
    assert [json.loads(note) for note in failed.value.__notes__] == [{k: says[k] for k in ("state", "reason")}]


def listed(job: dict[str, Any]) -> dict[str, Any]:
    """A job as the newest of its kind, and by itself."""
    return {f"jobs/{job['kind']}": {"items": [job], "next": None}, f"jobs/{job['id']}": job}


def test_a_run_under_way_shows_how_far_it_is_and_its_card_what_came_of_it(show: Any, service: Pretended) -> None:
    under_way = told.job("capture", "running", can=["cancel", "pause"])
    service.answers |= listed(under_way)
    page = show("run")
    card = page.locator("#capture-under-way")
    expect(card).to_contain_text("trial_002, 15 mm/s (1 of 3 trials)")
    expect(card).to_contain_text("about 21 s left")
    expect(page.locator("#capture-pause")).to_be_visible()
    holds_up(page, "state-running-run", (390,))
    service.answers["jobs/job-capture"] = told.job("capture", result=told.CAPTURED)
    expect(page.locator("#result")).to_contain_text("usable")
    expect(page.locator("#peak")).to_have_text("5.88")
    expect(page.locator("#next")).to_contain_text("fit the tissue")
    expect(page.locator("#open-session")).to_have_attribute("href", f"#/session/{told.NAME}")
    holds_up(page, "state-result-run", (390,))


def test_a_run_that_was_stopped_or_failed_says_why_and_what_is_kept(show: Any, service: Pretended) -> None:
    problem = {"code": "force_limit", "detail": "force 12.3 N is above the limit of 12 N; the tip was retracted"}
    failed = told.job("capture", "failed", problem=problem)
    service.answers |= listed(failed)
    page = show("run")
    expect(page.locator("#capture-ended")).to_contain_text("it failed")
    expect(page.locator("#capture-ended")).to_contain_text("force 12.3 N is above the limit of 12 N")
    holds_up(page, "state-failed-run", (390,))


def test_a_tracked_force_shows_its_levels_and_where_the_gains_come_from(show: Any, service: Pretended) -> None:
    tracked = told.job("track", result=told.TRACKED.model_dump(mode="json"))
    service.answers |= listed(tracked)
    page = show("track")
    expect(page.locator("#origin")).to_contain_text(f"index law, fitted to the session “{told.NAME}”")
    expect(page.locator("#rms")).to_have_text("0.011")
    expect(page.locator(".tracked")).to_contain_text(
        "with its jumps from force to force: error 0.014 N (root mean square), at most 0.30 N"
    )
    page.fill("#forces", "1, 40")
    expect(page.locator("#track-start-why")).to_have_text(TOO_MUCH)
    page.fill("#forces", "1; -2")
    expect(page.locator("#track-start-why")).to_contain_text("Give one force or several")
    page.fill("#forces", "1 2.5")
    expect(page.locator("#track-start")).to_be_enabled()
    holds_up(page, "state-result-track", (390,))


def test_curves_span_what_was_recorded_though_depth_is_not_known_at_first_and_have_the_model_over_them(
    show: Any,
) -> None:
    page = show("session")
    curves = page.locator("#curves")
    expect(curves.locator("canvas")).to_be_visible()
    low, high = (float(curves.get_attribute(f"data-{end}") or "nan") for end in ("from", "to"))
    assert -1.5 < low < -0.7 and 8.0 < high < 9.0
    expect(page.locator("#curves-card .swatch.dashed")).to_be_visible()
    page.click("#over-time")
    expect(page.locator("#over-time")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#curves")).to_have_attribute("aria-label", re.compile("against time"))


def test_files_of_a_session_that_are_too_many_to_list_are_counted(show: Any, service: Pretended) -> None:
    service.answers[f"sessions/{told.NAME}"] = told.SESSION.model_copy(update={"files_left_out": 7})
    page = show("session")
    page.click("text=12 files")
    expect(page.locator("#files li")).to_have_count(5)
    expect(page.locator("#not-listed")).to_have_text("7 more files are not listed; they are in the session's folder.")


def test_what_axe_is_for_is_found(show: Any) -> None:
    page = show("track")
    expect(page.locator("#track-form")).to_be_visible()
    page.evaluate("() => document.getElementById('track-start').replaceChildren()")
    assert any("button-name" in line for line in violations(page))


def test_a_protocol_that_the_bench_refuses_can_be_read_but_not_started(show: Any, service: Pretended) -> None:
    page = show("run")
    page.select_option("#protocol", "deep")
    expect(page.locator("#verdict")).to_contain_text("depth_mm 900 is above limits.depth_mm 25 mm")
    expect(page.locator("#capture-start")).to_be_disabled()
    holds_up(page, "state-refused-run", (390,))


def test_without_a_model_of_the_subject_the_ramp_says_what_to_do_first_and_leads_to_the_session_to_fit(
    show: Any, service: Pretended
) -> None:
    service.answers["models"] = told.nothing()["models"]
    page = show("run")
    page.click("#ramp summary")
    first = page.locator("#ramp-first")
    expect(first).to_contain_text(f"nothing is fitted to {told.SUBJECT} yet")
    expect(first).to_contain_text("Run a short protocol with it: that is done.")
    expect(page.locator("#ramp-fit")).to_have_attribute("href", f"#/session/{told.NAME}")
    expect(page.locator("#ramp-start")).to_have_count(0)
    holds_up(page, "state-no-model-run", (390,))


def test_somebody_elses_tissue_controls_a_ramp_only_where_a_person_chose_it_and_is_warned(
    show: Any, service: Pretended
) -> None:
    other = told.MODELS.items[0].model_copy(update={"subject": "S99"})
    service.answers["models"] = told.MODELS.model_copy(update={"items": (other,)})
    page = show("run")
    page.click("#ramp summary")
    expect(page.locator("#ramp-first")).to_be_visible()
    expect(page.locator("#ramp-start-why")).to_have_text("Choose the tissue whose model controls it.")
    page.select_option("#ramp-model", f"fit/{told.NAME}")
    expect(page.locator("#origin")).to_contain_text(f"This tissue is that of S99, not of {told.SUBJECT}")
    expect(page.locator("#ramp-start")).to_be_enabled()
    track = show("track")
    expect(track.locator("#origin")).to_contain_text(f"This tissue is that of S99, not of {told.SUBJECT}")


def test_the_arrow_keys_read_values_of_one_time_and_a_pause_keeps_what_is_shown(show: Any) -> None:
    page = show("bench")
    page.click("#plot-pause")
    expect(page.locator("#plot-pause")).to_have_text("Live")
    plot, said = page.locator("#force-plot"), page.locator(".readout")
    plot.focus()
    read: set[str] = set()
    for key, share in (("ArrowLeft", "99"), ("PageDown", "89"), ("PageDown", "79"), ("ArrowRight", "80")):
        page.keyboard.press(key)
        expect(plot).to_have_attribute("aria-valuenow", share)
        expect(plot).to_have_attribute("aria-valuetext", re.compile(r"^force [\d.]+ N, set-point [\d.]+ N, error"))
        text = said.text_content() or ""
        depth_mm, setpoint_N = (float(re.findall(rf"{name} ([\d.]+)", text)[0]) for name in ("depth", "set-point"))
        # As the pretended bench has it; a sample and a column of pixels lie between what the two are read at.
        assert setpoint_N == pytest.approx(0.12 * depth_mm * math.exp(0.22 * depth_mm), rel=0.05, abs=0.02)
        read.add(text)
    assert len(read) == 4
    page.click("#plot-pause")
    expect(page.locator("#plot-pause")).to_have_text("Pause")


ELSEWHERE = {"thigh": 6.0}
FOUND = {
    "force_N": 7.96, "up_to_N": 20.0, "recording": "glove_001.mcap", "subject": told.SUBJECT, "site": told.SITE,
    "input": "glove", "presses": [{"peak_N": 7.96, "seconds": 2.0, "refused": ""}], "rule": "the median of three",
}  # fmt: skip


def body_of(page: Page, button: str) -> Any:
    """What is put as the subject by a click."""
    with page.expect_request(lambda request: request.method == "PUT" and request.url.endswith("/subject")) as asked:
        page.click(button)
    return asked.value.post_data_json


def test_a_glove_s_threshold_is_its_site_s(show: Any, service: Pretended) -> None:
    subject = service.answers["subject"]
    assert isinstance(subject, dict)
    service.answers |= listed(told.job("threshold-glove", result=FOUND))
    service.answers |= IN_CONTROL | {"PUT subject": subject}
    service.says(rig=with_gloves("left"), subject=subject | {"site_thresholds_N": ELSEWHERE})
    page = show("run")
    page.click("#glove summary")
    expect(page.locator("#glove-keep")).to_have_text(f"Set 7.9 N as threshold at {told.SITE}")
    expect(page.locator("#threshold")).to_have_text("12.0")
    assert body_of(page, "#glove-keep") == {
        "id": told.SUBJECT, "site": told.SITE, "pain_threshold_N": 12.0,
        "site_thresholds_N": ELSEWHERE | {told.SITE: 7.9},
    }  # fmt: skip


def test_the_threshold_in_force_is_the_lower_at_its_site(show: Any, service: Pretended) -> None:
    subject = service.answers["subject"]
    assert isinstance(subject, dict)
    service.says(subject=subject | {"site_thresholds_N": {told.SITE: 7.9}})
    expect(show("run").locator("#threshold")).to_have_text("7.9")


def test_another_subject_does_not_get_the_sites_of_the_one_before(show: Any, service: Pretended) -> None:
    subject = service.answers["subject"]
    assert isinstance(subject, dict)
    service.answers |= IN_CONTROL | {"PUT subject": subject}
    service.says(subject=subject | {"site_thresholds_N": ELSEWHERE})
    page = show("run")
    page.fill("#subject-id", "S99")
    page.fill("#subject-threshold", "7")
    assert body_of(page, "#subject-keep") == {"id": "S99", "site": told.SITE, "pain_threshold_N": 7}
