"""The steps of the view Run: whose threshold holds and why, and what is said before anything starts."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.listing import Listing
from api.http.models import JobSummary, ProtocolView
from hatch_build import SOURCES, built_folder
from tests.page import told
from tests.page.looks import holds_up
from tests.page.pretend import IDLE, INFO, OPERATOR, Pretended, opened
from tests.page.steps import view

LEASE = {"lease_id": "l", "epoch": 1, "expires": told.AT}
ON_BENCH: dict[str, Any] = {"id": "S08", "site": told.SITE, "pain_threshold_N": 12.0, "site_thresholds_N": {}}
THEIRS = {"id": told.SUBJECT, "site": told.SITE, "pain_threshold_N": 14.0, "site_thresholds_N": {told.SITE: 3.57}}


@pytest.fixture
def service() -> Pretended:
    """S08 on the bench, and a session of S07, for somebody who may operate."""
    control = {"POST control/lease": LEASE, "PUT control/lease": LEASE}
    said: dict[str, Any] = {"auth/me": OPERATOR, "rig": IDLE, "info": INFO, "subject": ON_BENCH}
    session = {f"recordings/{told.NAME}/session.json": {"subject": THEIRS}}
    return Pretended(built_folder(SOURCES), told.everything() | control | said | session)


@pytest.fixture
def page(browser: Browser, service: Pretended) -> Iterator[Page]:
    errors: list[str] = []
    found = opened(browser, service, "run", errors)
    yield found
    found.context.close()
    assert errors == []


def puts(page: Page, service: Pretended, button: str, now: dict[str, Any]) -> Any:
    """What is put as the subject by a click, after which the service says ``now``."""
    service.answers |= {"subject": now, "PUT subject": now}
    with page.expect_request(lambda sent: sent.method == "PUT" and sent.url.endswith("/subject")) as asked:
        page.click(button)
    return asked.value.post_data_json


def test_nobody_gets_the_threshold_of_another(page: Page, service: Pretended) -> None:
    field, hint, why = (page.locator(f"#subject-{name}") for name in ("threshold", "threshold-hint", "keep-why"))
    page.fill("#subject-id", "S99")
    expect(field).to_have_value("")
    expect(hint).to_contain_text("Nothing is known of S99 yet. Give a force that they surely bear")
    expect(hint).to_contain_text("the axis homes: the limb must be out")
    expect(why).to_have_text("Give their pain threshold.")
    expect(page.locator("#capture-start-why")).to_contain_text("step 1 is not in use yet")
    expect(page.locator("#capture-start")).to_be_disabled()
    holds_up(page, "state-unknown-subject-run", (390,))
    page.fill("#subject-threshold", "9")
    page.fill("#subject-id", "S98")
    expect(field).to_have_value("")
    page.fill("#subject-id", "   ")
    expect(why).to_have_text("Give the code of the subject; blanks alone are none.")

    page.fill("#subject-id", told.SUBJECT)
    expect(field).to_have_value("3.5")
    expect(hint).to_contain_text(f"3.5 N was in force in their session {told.NAME}")
    asked = puts(page, service, "#subject-keep", ON_BENCH | {"id": told.SUBJECT, "pain_threshold_N": 3.5})
    assert asked == {"id": told.SUBJECT, "site": told.SITE, "pain_threshold_N": 3.5}
    message = f"on the bench: {told.SUBJECT}, {told.SITE}; pain threshold in force: 12.0 N → 3.5 N"
    expect(page.locator("#message")).to_have_text(message)
    expect(field).to_have_count(0)
    expect(page.locator("#capture-start")).to_be_enabled()

    page.fill("#subject-site", "calf")
    expect(field).to_have_value("3.5")
    expect(hint).to_contain_text(f"3.5 N is in force now, at {told.SITE}. Change it where it does not hold")


def test_whom_a_service_that_began_anew_has_forgotten_is_said(page: Page, service: Pretended) -> None:
    page.fill("#subject-id", "S99")
    page.fill("#subject-threshold", "9")
    puts(page, service, "#subject-keep", ON_BENCH | {"id": "S99", "pain_threshold_N": 9.0})
    expect(page.locator("#message")).to_contain_text("on the bench: S99")
    expect(page.locator("#subject-gone")).to_have_count(0)
    service.answers |= {"subject": ON_BENCH}
    page.reload()
    expect(page.locator("#subject-gone")).to_contain_text(f"S99 ({told.SITE}, 9.0 N) was put on the bench from here")
    expect(page.locator("#subject-gone")).to_contain_text(f"S08 ({told.SITE}, 12.0 N) is on it")
    holds_up(page, "state-forgotten-subject-run", (390,))
    page.click("#subject-right")
    expect(page.locator("#subject-gone")).to_have_count(0)


def test_the_threshold_of_a_site_that_holds_is_said_and_can_be_replaced(page: Page, service: Pretended) -> None:
    found = ON_BENCH | {"site_thresholds_N": {told.SITE: 3.5}}
    page.fill("#threshold-known", "14")
    assert puts(page, service, "#threshold-keep", found | {"pain_threshold_N": 14.0})["pain_threshold_N"] == 14
    in_force = "pain threshold in force: 12.0 N → 3.5 N, that of left forearm: it is lower than the 14.0 N that is set"
    expect(page.locator("#message")).to_contain_text(in_force)
    expect(page.locator("#threshold")).to_have_text("3.5")
    expect(page.locator("#threshold-keep-why")).to_have_text("is set, and not in force")
    expect(page.locator("#site-rules")).to_contain_text("left forearm has a threshold of its own, which is lower")
    page.click("#ramp summary")
    expect(page.locator("#ramp-up-to")).to_have_value("3.5")
    holds_up(page, "state-site-rules-run", (390,))
    replaced = ON_BENCH | {"pain_threshold_N": 14.0, "site_thresholds_N": {told.SITE: 14.0}}
    assert puts(page, service, "#site-replace", replaced)["site_thresholds_N"] == {told.SITE: 14}
    expect(page.locator("#message")).to_have_text("pain threshold in force: 3.5 N → 14.0 N")
    expect(page.locator("#site-rules")).to_have_count(0)
    expect(page.locator("#ramp-up-to")).to_have_value("12")


def test_a_ramp_s_threshold_is_never_above_what_was_found_and_only_of_whom_it_was(
    page: Page, service: Pretended
) -> None:
    found = {"force_N": 3.57, "up_to_N": 12.0, "recording": "track_001.mcap", "site": ""}
    job = told.job("threshold", result=found)
    service.answers |= {"jobs/threshold": {"items": [job], "next": None}, "jobs/job-threshold": job}
    page.reload()
    page.click("#ramp summary")
    expect(page.locator("#ramp-result")).to_contain_text("The subject stopped at 3.57 N")
    expect(page.locator("#ramp-keep")).to_have_count(0)
    theirs = ON_BENCH | {"id": told.SUBJECT}
    service.says(subject=theirs)
    page.reload()
    page.click("#ramp summary")
    expect(page.locator("#ramp-keep")).to_have_text("Set 3.5 N as threshold")
    asked = puts(page, service, "#ramp-keep", theirs | {"pain_threshold_N": 3.5})
    assert asked["pain_threshold_N"] == 3.5
    expect(page.locator("#message")).to_have_text("pain threshold in force: 12.0 N → 3.5 N")


def test_what_was_written_for_one_person_is_not_the_next_one_s(page: Page, service: Pretended) -> None:
    page.click("#glove summary")
    expect(page.locator("#glove-session")).to_have_value("thresholds-S08")
    page.fill("#subject-id", "S99")
    page.fill("#subject-threshold", "5")
    puts(page, service, "#subject-keep", ON_BENCH | {"id": "S99", "pain_threshold_N": 5.0})
    expect(page.locator("#glove-session")).to_have_value("thresholds-S99")
    page.click("#ramp summary")
    expect(page.locator("#ramp-up-to")).to_have_value("5")


def test_a_ramp_by_another_s_tissue_is_no_part_of_the_other_s_session(page: Page, service: Pretended) -> None:
    begun = told.job("threshold", "running")
    service.answers |= {"POST jobs": begun, "jobs/job-threshold": begun}
    asked = []
    for whom, site in (("S08", told.SITE), (told.SUBJECT, "calf"), (told.SUBJECT, told.SITE)):
        service.says(subject=ON_BENCH | {"id": whom, "site": site})
        page.reload()
        page.click("#ramp summary")
        page.select_option("#ramp-model", f"fit/{told.NAME}")
        with page.expect_request(lambda sent: sent.method == "POST" and sent.url.endswith("/jobs")) as sent:
            page.click("#ramp-start")
        body = sent.value.post_data_json or {}
        asked.append(body["params"].get("session", ""))
    assert [session.rpartition("-")[0][:10] for session in asked] == ["threshold-", "threshold-", ""]


def test_without_anybody_on_the_bench_nothing_starts(page: Page, service: Pretended) -> None:
    service.says(subject=ON_BENCH | {"id": ""})
    page.reload()
    expect(page.locator("#capture-start-why")).to_contain_text("Nobody is on the bench")
    expect(page.locator("#capture-start")).to_be_disabled()


def test_a_protocol_above_the_threshold_is_shown_with_the_force_at_which_it_ends(
    page: Page, service: Pretended
) -> None:
    expect(page.locator("#contents")).to_contain_text("force limit12.0 N")
    expect(page.locator("#lowered")).to_have_count(0)
    lower = told.FORESIGHT.model_copy(update={"force_limit_N": 3.2})
    service.says(protocols__quick__foresight=lower)
    page.reload()
    expect(page.locator("#contents")).to_contain_text("force limit3.2 N")
    expect(page.locator("#lowered")).to_contain_text("The protocol says 12.0 N, which is more than this subject's")


def test_a_protocol_is_shown_as_deep_as_it_goes_and_stays_chosen_and_its_session_s_name_is_asked_for_in_words(
    page: Page, service: Pretended
) -> None:
    settings = told.SETTINGS | {"depth_mm": 5.0, "second_depth_mm": 7.5, "dither_amplitude_mm": 0.3}
    twice = ProtocolView(name="twice", file="twice.toml", settings=settings, refusal="")
    seen = told.FORESIGHT.model_copy(update={"protocol": "twice", "depth_mm": 7.5, "expected": ()})
    service.says(protocols=Listing[ProtocolView](items=[*told.PROTOCOLS, twice]), protocols__twice__foresight=seen)
    page.reload()
    expect(page.locator("#contents")).to_contain_text("depth8.0 mm")
    expect(page.locator("#beyond")).to_have_count(0)
    page.select_option("#protocol", "twice")
    expect(page.locator("#contents")).to_contain_text("deepest7.5 mm")
    expect(page.locator("#beyond")).to_have_text(
        "At 5 mm it swings by 0.3 mm to either side. It presses to 5 mm, then to 7.5 mm."
    )
    view(page, "Bench")
    view(page, "Run")
    expect(page.locator("#protocol")).to_have_value("twice")
    page.reload()
    expect(page.locator("#protocol")).to_have_value("twice")
    service.says(protocols=Listing[ProtocolView](items=told.PROTOCOLS))
    page.reload()
    expect(page.locator("#protocol")).to_have_value("quick")

    expect(page.locator("#session-hint")).to_contain_text("no blanks")
    expect(page.locator("#capture-start")).to_be_enabled()
    page.fill("#session", "first visit")
    expect(page.locator("#capture-start-why")).to_contain_text("This name will not do: it may hold letters")
    holds_up(page, "state-no-name-run", (390,))
    page.fill("#session", "first-visit")
    expect(page.locator("#capture-start")).to_be_enabled()


def test_a_run_that_is_begun_anywhere_is_shown_and_what_was_said_of_its_start_does_not_outlast_it(
    page: Page, service: Pretended
) -> None:
    stopped = told.job("capture", "cancelled")
    service.answers |= {"jobs/capture": {"items": [stopped], "next": None}, "jobs/job-capture": stopped}
    page.reload()
    expect(page.locator("#capture-ended")).to_contain_text("it was stopped")
    begun = told.job("capture", "running", id="job-2")
    service.answers["jobs/job-2"] = begun
    summary = JobSummary.model_validate({name: begun[name] for name in begun.keys() & JobSummary.model_fields})
    service.says(rig=IDLE.model_copy(update={"state": "running", "job": summary}))
    expect(page.locator("#capture-under-way")).to_contain_text("trial_002")
    service.answers |= {"jobs/job-2": begun | {"state": "cancelled"}, "rig": IDLE}
    expect(page.locator("#capture-ended")).to_be_visible()

    own = begun | {"id": "job-3"}
    service.answers |= {"jobs/job-3": own, "POST jobs": own}
    with page.expect_response(lambda answer: answer.request.method == "POST" and answer.url.endswith("/jobs")):
        page.click("#capture-start")
    expect(page.locator("#now-force")).to_be_visible()
    expect(page.locator("#message")).to_have_text("")
