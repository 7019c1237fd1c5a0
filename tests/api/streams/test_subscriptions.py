"""Clients that stand at the same places share what is due to them; who stands elsewhere gets their own."""

from collections.abc import Sequence

import numpy as np
import pytest

from api.http.streams.history import LiveHistory
from api.http.streams.messages import Gap
from api.http.streams.signals import signals
from api.http.streams.subscriptions import SharedTurn, Subscription
from api.http.streams.views import View
from rig.config.wiring import Wiring

FORCE = signals(Wiring())["force"]
VIEW = View(1, FORCE, 0.0, "none")


def of(numbers: Sequence[int]) -> LiveHistory:
    """A history of a sensor that gave these numbers, a millisecond apart."""
    history = LiveHistory(FORCE.fields, 1000.0)
    rows = np.zeros(len(numbers), history.dtype)
    rows["seq"], rows["time_ns"] = numbers, np.array(numbers) * 1_000_000
    history.add(rows)
    return history


def shared(turn: SharedTurn, at: Subscription, now_ns: int = 1) -> list[Gap | bytes]:
    """What is due to a client with this place alone."""
    return turn.due((at,), now_ns)[0]


def test_clients_at_one_place_share_what_is_made_for_one_of_them() -> None:
    turn, at = SharedTurn(), Subscription.begun(VIEW, of(range(1, 11)), 1.0, "oldest")
    assert shared(turn, at)[0] is shared(turn, at._replace())[0]


def test_the_next_turn_is_made_anew() -> None:
    history, turn = of(range(1, 11)), SharedTurn()
    _, then = turn.due((Subscription.begun(VIEW, history, 1.0, "oldest"),), 1)
    assert turn.due(then, 1)[0] == []
    rows = history.between(0, 1)
    rows["seq"], rows["time_ns"] = 11, 11_000_000
    history.add(rows)
    assert len(turn.due(then, 2)[0]) == 1


@pytest.mark.parametrize(("last_seq", "first"), [(5, 6), (7, 8), (9, None)])
def test_who_had_another_sample_last_is_told_their_own_gap(last_seq: int, first: int | None) -> None:
    """Planted by what they have in common: view, history and place are the same."""
    turn, at = SharedTurn(), Subscription.begun(VIEW, of(range(10, 20)), 1.0, "oldest")
    assert [type(said) for said in shared(turn, at)] == [bytes]
    *gaps, data = shared(turn, at._replace(last_seq=last_seq))
    assert isinstance(data, bytes)
    assert [(gap.first, gap.last) for gap in gaps if isinstance(gap, Gap)] == ([(first, 9)] if first else [])


def test_a_gap_has_the_cause_of_its_own_client() -> None:
    turn = SharedTurn()
    at = Subscription.begun(VIEW, of(range(10, 20)), 1.0, "oldest")._replace(last_seq=5)
    causes = [shared(turn, at._replace(cause=cause))[0] for cause in ("slow", "source")]
    assert [gap.cause for gap in causes if isinstance(gap, Gap)] == ["slow", "source"]
