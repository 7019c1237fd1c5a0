"""The hazard table is complete, its tests exist, and the page is what command, table and results make of it."""

import json
import re

import pytest

from benchmarks.faults.catalogue import FAULTS
from benchmarks.faults.document import BESIDES, PAGE, RESULTS, ROOT, page
from benchmarks.faults.hazards import HAZARDS, TESTS
from benchmarks.faults.plants import plants
from benchmarks.faults.results import read
from controller.safety.table import TABLE

CODES = [*(line.code for line in TABLE), *BESIDES]


@pytest.mark.parametrize("code", CODES)
def test_every_check_has_a_hazard_and_a_test_that_exists(code: str) -> None:
    assert any(code in hazard.checks for hazard in HAZARDS)
    path, _, name = TESTS[code].partition("::")
    text = (ROOT / path).read_text()
    assert re.search(rf"^def {name}\(", text, re.MULTILINE), TESTS[code]
    assert code in BESIDES or f'"{code}"' in text, f"{path} does not name {code}"


def test_every_hazard_has_checks_that_exist_causes_and_what_is_left() -> None:
    for hazard in HAZARDS:
        assert hazard.checks
        assert set(hazard.checks) <= set(CODES)
        assert hazard.causes
        assert hazard.left
    assert set(TESTS) == set(CODES)


def test_the_kept_results_hold_no_failure_and_no_planted_bug_that_was_not_reported() -> None:
    done = read(RESULTS)
    assert [one for one in done if not one.plant and (one.unnoticed or one.unsafe)] == []
    assert [one for one in done if one.plant and not (one.unnoticed or one.unsafe)] == []


def test_the_kept_results_are_of_every_fault_and_every_plant() -> None:
    done = read(RESULTS)
    assert {one.fault for one in done if not one.plant} == set(FAULTS)
    assert {one.plant for one in done if one.plant} == set(plants())


def test_what_the_results_do_not_hold_is_said_by_name() -> None:
    done = read(RESULTS)
    without = [one for one in done if one.noticed_by != "force_limit" and one.plant != "force_rate"]
    said = page(without, "2026-01-01")
    missing = next(line for line in said.splitlines() if line.startswith("Not measured in these results"))
    unplanted = next(line for line in said.splitlines() if line.startswith("Not planted in these results"))
    assert "`force_limit`" in missing
    assert "`force_rate`" in unplanted
    for line in TABLE:
        measured = any(one.noticed_by == line.code and not one.unnoticed for one in without if not one.plant)
        assert (f"`{line.code}`" in missing) is not measured


def test_the_page_is_current() -> None:
    made = page(read(RESULTS), json.loads(RESULTS.read_text())["date"])
    assert PAGE.read_text() == made, "run python -m benchmarks.faults.document"
