"""What is offered for an open question is no answer until somebody has put what is true in it."""

import tomllib
from pathlib import Path

import pytest

from rig.config.table import parse
from rig.errors import UsageError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.questions import JointQuestion
from tests.rig.intake.instruments import text
from tests.rig.intake.test_foreign import FORCE_N, TIME_S, WAY_MM, lines

COUNTS = lines("{:.3f},{:.5f},{:.0f}", TIME_S, WAY_MM, FORCE_N * 1e3)
WITHOUT_TIME = lines("{:.5f},{:.5f}", WAY_MM, FORCE_N)
HEADS = {
    "no time": ("Position (mm),Force (N)\n", WITHOUT_TIME, "time.rate_Hz"),
    "counts of a sensor": ("Time (s),Position (mm),Force (count)\n", COUNTS, "columns.force.scale"),
    "no names": ("Time (s),a,b\n", COUNTS, "columns.force.column"),
}


@pytest.mark.parametrize("head", HEADS)
def test_a_line_that_is_offered_is_refused_as_long_as_it_is_open(folder: Path, head: str) -> None:
    names, rows, place = HEADS[head]
    text(names, rows)(folder)
    proposal = propose(folder)
    questions = [
        part for each in proposal.questions for part in (each.parts if isinstance(each, JointQuestion) else [each])
    ]
    given = [question.line for question in questions]
    keys = tuple(f"{line.partition(' = ')[0]} = " for line in given)
    kept = [line for line in proposal.text.splitlines() if not line.startswith(keys)]
    tree = tomllib.loads("\n".join([*kept, *given]))
    with pytest.raises(UsageError, match=rf"{place}: this is still open: write what is true in place of '\?'"):
        parse(DataMapping, tree, "proposed")


@pytest.mark.parametrize("head", HEADS)
def test_nor_is_what_an_answer_looks_like(folder: Path, head: str) -> None:
    names, rows, _ = HEADS[head]
    text(names, rows)(folder)
    for question in propose(folder).questions:
        assert question.usual == ""
        with pytest.raises(UsageError):
            question.value(question.form)
