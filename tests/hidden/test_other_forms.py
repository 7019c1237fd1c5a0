"""Sessions of other forms, which nobody has seen: each run draws its own seed and prints it (``TISSUE_RIG_SEED``).

They cannot show a rate of one in a hundred; they fail where even a few contradict it, which chance does once in a
thousand runs. Rates are counted by ``python -m benchmarks.criticism --campaign forms``.
"""

import pytest

from benchmarks.campaigns.case import Answer, Named
from benchmarks.campaigns.engine import answer
from benchmarks.campaigns.forms import FORMS, case_of, record
from benchmarks.forms.draw import ROTATION
from tests.hidden.promises import contradicted, of_kind


@pytest.mark.campaign
@pytest.mark.timeout(300)  # two diagnoses take 2 to 30 s of a core each, which others may use too
def test_new_sessions_of_other_forms_do_not_contradict_what_is_promised() -> None:
    records = [record(of_kind(kind, ROTATION), answer) for kind in ("clean", "tissue")]
    assert not contradicted(FORMS, records), [one.line for one in records]
    assert all(one.answer.left_N is not None and one.answer.noise_N is not None for one in records)


def test_an_engine_that_names_what_is_not_there_contradicts_it() -> None:
    wrong = Answer("explained", (Named(("friction",), True, 1.0),))
    records = [record(of_kind(kind, ROTATION), lambda _: wrong) for kind in ("clean", "tissue")]
    assert [line.split(" 2/2")[0].strip() for line in contradicted(FORMS, records)] == [
        "sessions with a certain wrong name"
    ]
    assert case_of(records[0].seed).truth.is_clean
