"""Results that are remembered are those of the arguments asked with, whatever became of arrays given before."""

from collections.abc import Callable

import numpy as np
import pytest

from rig.remembered import KEPT, known_of, remembered


class Counted:
    """A function of an array and a number, and how often it was worked out."""

    def __init__(self) -> None:
        self.times = 0

    def __call__(self, values: np.ndarray, factor: float = 2.0) -> np.ndarray:
        self.times += 1
        return factor * values


@pytest.fixture
def counted() -> Counted:
    return Counted()


def wrapped(counted: Counted) -> Callable[..., np.ndarray]:
    return remembered(counted)


def test_equal_arguments_are_worked_out_once_whichever_array_holds_them(counted: Counted) -> None:
    asked, values = wrapped(counted), np.arange(5.0)
    np.testing.assert_array_equal(asked(values, 3.0), [0, 3, 6, 9, 12])
    assert asked(values.copy(), 3.0) is asked(values, 3.0)
    assert counted.times == 1


@pytest.mark.parametrize("place", range(5))
def test_an_array_that_was_written_into_is_another_argument(counted: Counted, place: int) -> None:
    asked, values = wrapped(counted), np.arange(5.0)
    asked(values)
    values[place] += 1e-12
    np.testing.assert_array_equal(asked(values), 2 * values)
    assert counted.times == 2


def test_other_numbers_and_fewer_arguments_are_other_arguments(counted: Counted) -> None:
    asked, values = wrapped(counted), np.arange(3.0)
    for factor in (3.0, 4.0):
        np.testing.assert_array_equal(asked(values, factor), factor * values)
    np.testing.assert_array_equal(asked(values), 2 * values)
    np.testing.assert_array_equal(asked(np.arange(4.0)), 2 * np.arange(4.0))
    assert counted.times == 4


def test_what_was_asked_last_is_kept_longest(counted: Counted) -> None:
    asked, values = wrapped(counted), np.arange(3.0)
    for factor in range(KEPT + 2):
        asked(values, float(factor))
        asked(values, 0.0)
    assert counted.times == KEPT + 2


def test_a_result_cannot_be_written_into(counted: Counted) -> None:
    with pytest.raises(ValueError, match="read-only"):
        wrapped(counted)(np.arange(3.0))[0] = 5.0


class Model:
    """Something results are kept with."""


def test_results_are_kept_with_their_object_and_with_no_other() -> None:
    asked = list[tuple[object, ...]]()

    @known_of
    def found(model: Model, *given: object) -> int:
        asked.append((model, *given))
        return len(asked)

    one, other, blind = Model(), Model(), np.array([True, False])
    assert [found(one, blind), found(one, blind.copy()), found(other, blind), found(one, ~blind)] == [1, 1, 2, 3]
    assert [found(one, ("a",)), found(one, ("a", "b")), found(one, ("a",))] == [4, 5, 4]
