"""What the views of sessions and models say of one whose recording was cut off, and of diagnoses that named nothing."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from api.http.jobs.views import FileView
from api.http.models import RecordingView
from rig.results.recorded import VerifiedTrial, VerifyResult
from tests.page import told, told_lab
from tests.page.looks import holds_up
from tests.page.pretend import Pretended, Show, resting, showing
from tests.page.steps import view

SESSION, TRIALS, MODELS = f"session/{told.NAME}", told.nothing()["trials"], told.MODELS.items
UNLISTED = "trial_001.mcap: not listed in session.json"


@pytest.fixture
def service() -> Pretended:
    return resting()


@pytest.fixture
def show(browser: Browser, service: Pretended) -> Iterator[Show]:
    with showing(browser, service) as at:
        yield at


def test_a_session_that_was_cut_off_says_what_of_it_can_be_used_and_what_is_not_as_it_should_be(
    show: Show, service: Pretended
) -> None:
    recording = RecordingView(session=told.NAME, file="trial_001.mcap", bytes=9, href="/")
    cut = {"trials": 0, "remarks": [UNLISTED], "recordings": [recording]}
    whole = VerifiedTrial(state="complete", ok=True, sentence="complete", damage=(), streams={})
    verified = VerifyResult(ok=False, remarks=(UNLISTED,), recordings={"trial_001": whole})
    done = told.job("verify", result=verified.model_dump(mode="json"))
    service.answers |= {"trials": TRIALS, f"sessions/{told.NAME}": told.SESSION.model_copy(update=cut)}
    service.answers |= {"jobs/verify": {"items": [done], "next": None}, "jobs/job-verify": done}
    page = show(SESSION)
    expect(page.locator("#unlisted")).to_contain_text("Curves, fits and exports read it all the same")
    expect(page.locator("#trials-card")).not_to_contain_text("No trial was made here")
    expect(page.locator("#whole")).to_have_text("Every recording is whole, but the session is not as it should be:")
    expect(page.locator("#files-card")).to_contain_text(UNLISTED)
    holds_up(page, "state-cut-off-session", (390,))


def test_files_of_a_session_have_sizes_that_say_something_and_none_that_gives_a_demonstration_away(
    show: Show, service: Pretended
) -> None:
    sizes = {"session.json": 412, "report.html": 4_120, "trial_001.mcap": 1_230_000, "diagnosis/truth.txt": 90}
    files = [FileView(name=name, href="/", bytes=size, media_type="text/plain") for name, size in sizes.items()]
    service.answers[f"sessions/{told.NAME}"] = told.SESSION.model_copy(update={"files": files})
    page = show(SESSION)
    page.click("text=3 files")
    said = ["session.json 412 bytes", "report.html 4 kB", "trial_001.mcap 1.23 MB"]
    expect(page.locator("#files li")).to_have_text(said)
    view(page, "Sessions")
    expect(page.locator("#recordings thead")).to_contain_text("recordings")
    expect(page.locator("#recordings thead")).not_to_contain_text("Trials")


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("adequate", "the data show none that acts above the noise"),
        ("unexplained", "none of those known explains what is left"),
        ("not judged", "what is wrong cannot be told from noise here"),
    ],
)
def test_that_no_cause_is_named_is_said_with_the_reason_of_that_diagnosis(
    show: Show, service: Pretended, verdict: str, said: str
) -> None:
    found = told.DIAGNOSIS.model_copy(update={"verdict": verdict, "findings": ()})
    service.answers[f"recordings/{told.NAME}/diagnosis/diagnosis.json"] = found
    expect(show(SESSION).locator("#no-cause")).to_have_text(f"No cause is named: {said}.")


def test_a_model_of_a_diagnosis_says_whether_it_names_causes_and_gives_way_to_a_fit_where_it_does_not(
    show: Show, service: Pretended
) -> None:
    diagnosed = {"file": "diagnosis/model.json", "law": "extended"}
    bare = MODELS[0].model_copy(update=diagnosed | {"session": "bare", "key": "2"})
    named = MODELS[0].model_copy(update=diagnosed | {"session": "named", "key": "3", "causes": ("guide_friction",)})
    service.says(models=told.MODELS.model_copy(update={"items": (bare, named, *MODELS)}))
    page = show("track")
    choice, origin = page.locator("#track-model"), page.locator("#origin")
    expect(choice.locator("option")).to_have_text(
        [
            f"named, {told.SUBJECT}, {told.SITE} (with the causes named)",
            f"{told.NAME}, {told.SUBJECT}, {told.SITE}",
            f"bare, {told.SUBJECT}, {told.SITE} (from its diagnosis, no cause named)",
        ]
    )
    expect(origin).to_contain_text("Its diagnosis named: guide friction.")
    choice.select_option("diagnosis/bare")
    expect(origin).to_contain_text("fitted to the session “bare”")
    expect(origin).to_contain_text("Its diagnosis named no cause")
    holds_up(page, "state-bare-model-track", (1280, 390))


def test_curves_over_time_have_a_key_for_the_set_point_in_a_colour_of_its_own(show: Show, service: Pretended) -> None:
    first, *others = told.CURVES.curves
    tracked = first.model_copy(update={"reference_N": first.force_N})
    curves = told.CURVES.model_copy(update={"curves": (tracked, *others)})
    service.answers[f"sessions/{told.NAME}/curves"] = curves
    page = show(SESSION)
    keys = page.locator("#curves-card .key-line span")
    expect(keys.filter(has_text="set-point")).to_have_count(0)
    page.click("#over-time")
    expect(keys).to_have_text(["trials", "usable trials", "set-point"])
    expect(keys.nth(2).locator(".dashed")).to_be_visible()
    colours = keys.locator("i").evaluate_all("all => all.map((one) => getComputedStyle(one).borderTopColor)")
    assert len(set(colours)) == 3


def test_an_export_that_takes_long_is_waited_for_and_then_saved_and_a_refused_one_is_told(
    show: Show, service: Pretended
) -> None:
    asked = f"sessions/{told.NAME}/export/csv"
    service.answers[asked] = 202
    page = show(SESSION)
    page.click("#export-csv")
    expect(page.locator("#exporting")).to_contain_text("it is saved as soon as it is there")
    expect(page.locator("#export-csv")).to_have_attribute("aria-busy", "true")
    with page.expect_download() as saved:
        service.answers[asked] = "all of it"
    assert saved.value.url.endswith(f"/{asked}")
    expect(page.locator("#exporting")).to_have_count(0)
    service.answers[asked] = 507
    page.click("#export-csv")
    expect(page.locator("#message")).to_contain_text("is refused here")


def test_beside_a_result_the_cards_of_tracking_keep_their_width(show: Show, service: Pretended) -> None:
    done = told.job("track", result=told.TRACKED.model_dump(mode="json"))
    service.answers |= {"jobs/track": {"items": [done], "next": None}, "jobs/job-track": done}
    page = show("track")
    page.set_viewport_size({"width": 1280, "height": 900})
    expect(page.locator("#track-result")).to_be_visible()
    for card in ("#track-what", "#track-live"):
        box = page.locator(card).bounding_box()
        assert box and box["width"] > 550


def test_one_fitted_session_alone_is_drawn_over_days(show: Show, service: Pretended) -> None:
    known = told_lab.HISTORY
    one = known.model_copy(update={"stiffness": known.stiffness[:1]})
    service.answers |= told_lab.around() | {f"subjects/{told.SUBJECT}": one}
    plot = show(f"subjects/{told.SUBJECT}").locator("#stiffness-plot")
    expect(plot.locator("canvas")).to_be_visible()
    assert float(plot.get_attribute("data-to") or "nan") >= 1.0
