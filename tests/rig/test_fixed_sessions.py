"""Sessions that are always the same get the answers they got, to 1e-9, however the code between is arranged."""

import json
from collections.abc import Iterator, Mapping

import pytest

from tests.data import absent
from tests.rig.fixed_sessions import FILE, SESSIONS, in_one_arithmetic

pytestmark = pytest.mark.timeout(300)
KEPT = json.loads(FILE.read_text())
# Other kernels of linear algebra moved the optimum of a fit by up to 1e-6.
OTHER_ARITHMETIC = 1e-5


def leaves(value: object, place: str = "") -> Iterator[tuple[str, object]]:
    """Every number, word and gap of a tree with its place in it."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from leaves(item, f"{place}.{name}")
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from leaves(item, f"{place}[{number}]")
    else:
        yield place, value


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """The figures of today."""
    return in_one_arithmetic(tmp_path_factory.mktemp("fixed") / "figures.json")


@pytest.mark.parametrize("name", SESSIONS)
def test_a_fixed_session_gets_the_answer_it_got(name: str, found: dict[str, object]) -> None:
    if name not in found:
        absent("the recordings are not on this machine")
    now, kept = dict(leaves(found[name])), dict(leaves(KEPT[name]))
    close = 1e-9 if found["arithmetic"] == KEPT["arithmetic"] else OTHER_ARITHMETIC
    assert now.keys() == kept.keys()
    assert not {place: (value, kept[place]) for place, value in now.items() if not same(value, kept[place], close)}


def same(value: object, kept: object, close: float) -> bool:
    """Equal, numbers to ``close``, relative or absolute."""
    return bool(value == pytest.approx(kept, rel=close, abs=close)) if is_number(kept) else value == kept


def is_number(value: object) -> bool:
    return isinstance(value, float | int) and not isinstance(value, bool)
