"""Every view of the page: where it is, what is there once it has loaded, and what acts on the bench from it."""

from typing import NamedTuple

from playwright.sync_api import Page, expect

from tests.page import told


class View(NamedTuple):
    """Its address, what is there once it has loaded, and what it says where there is nothing yet."""

    place: str
    there: str
    empty: str


VIEWS = {
    "bench": View("bench", "#force-plot canvas", "No device is connected."),
    "run": View("run", "#verdict", "No protocol lies in the protocols folder"),
    "sessions": View("sessions", "#recordings", "No session yet"),
    "session": View(f"session/{told.NAME}", "#diagnosis-result", "could not be loaded"),
    "track": View("track", "#track-form", "Nothing is fitted yet"),
    "data": View("data", "#upload", "Choose files first"),
    "subjects": View("subjects", "#subjects", "No subject yet"),
    "subject": View(f"subjects/{told.SUBJECT}", "#subject-sessions", "No session is left of this subject"),
    "devices": View("devices", "#calibrations", "until they are, the bench does not approach anybody"),
    "admin": View("admin", "#audit", "No program has a token."),
}
# These ask for nothing before they can be shown.
AT_ONCE = ("bench", "data")
STARTS = (
    "capture-start", "ramp-start", "track-start", "subject-keep", "threshold-keep", "fit-start", "diagnose-start",
    "report-start", "verify-start", "doctor", "read", "erase", "retract",
    "calibrate-force", "calibrate-glove", "calibrate-axis", "calibrate-dynamics",
)  # fmt: skip
# What moves the tip, of the views that have it.
MOVES = {"run": "#capture-start", "track": "#track-start", "bench": "#retract"}


def go(page: Page, where: str) -> Page:
    """To a view, by its address."""
    page.evaluate("(place) => { location.hash = `#/${place}`; }", VIEWS[where].place)
    return page


def none_starts(page: Page) -> None:
    """Nothing that acts on the bench can be pressed."""
    _disabled(page, ", ".join(f"#{start}" for start in STARTS))


def none_moves(page: Page) -> None:
    """Nothing that moves the tip can."""
    _disabled(page, ", ".join(MOVES.values()))


def _disabled(page: Page, which: str) -> None:
    for button in page.locator(which).all():
        expect(button).to_be_disabled()
