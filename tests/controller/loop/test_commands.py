"""What the loop does with messages: each is answered by its id, and none stops it from cycling."""

from collections.abc import Iterator
from typing import cast

import pytest

from controller.loop.commands import Inbox
from controller.loop.messages import FROM_LOOP, TO_LOOP, Finished, Lease, Note, Reset, Run, Shutdown, StatusSaid
from controller.loop.modes import Mode
from controller.loop.steps import Program
from rig.channel import Answer, Channel, Message, encode, pair
from tests.controller.fake_bench import APPROACH, HOLD, ZERO, FakeBench


class Linked(FakeBench):
    """A bench of fakes whose loop listens to a real channel."""

    def __init__(self) -> None:
        super().__init__()
        self.keep_lease = False
        mine, theirs = pair()
        self.raw, self.mine, self.theirs = mine, Channel(mine, FROM_LOOP), Channel(theirs, TO_LOOP)
        self.loop._channel = self.theirs
        self.loop._commands = Inbox(self.theirs, self.responder)

    def replies(self) -> list[Message]:
        """What the loop has said, its status left out."""
        found: list[Message] = []
        for _ in range(20):
            found += [received.message for received in self.mine.receive_all()]
        return [message for message in found if not isinstance(message, StatusSaid)]

    def close(self) -> None:
        self.mine.close()
        self.theirs.close()


@pytest.fixture
def bench() -> Iterator[Linked]:
    linked = Linked()
    yield linked
    linked.close()


def test_a_program_is_answered_and_its_outcome_carries_its_id(bench: Linked) -> None:
    number = bench.mine.send(Run(program=Program(name="zero", steps=(ZERO,))))
    bench.wait(0.5)
    answer, finished = bench.replies()
    assert answer == Answer(to=number)
    assert isinstance(finished, Finished)
    assert (finished.program, finished.outcome.outcome) == (number, "complete")


def test_a_second_program_is_refused_by_its_id_and_the_first_goes_on(bench: Linked) -> None:
    first = bench.mine.send(Run(program=Program(name="one", steps=(ZERO, APPROACH, HOLD))))
    second = bench.mine.send(Run(program=Program(name="two", steps=(ZERO,))))
    bench.cycles(5)
    taken, refused = bench.replies()
    assert taken == Answer(to=first)
    assert refused == Answer(to=second, refused="a program is already under way: stop it or wait for its end")
    assert bench.loop.machine.busy


def test_a_loop_told_to_end_retracts_before_it_leaves(bench: Linked) -> None:
    bench.mine.send(Run(program=Program(name="one", steps=(ZERO, APPROACH, HOLD))))
    bench.until(lambda: bench.mode is Mode.COMPRESS)
    inbox = bench.loop._commands
    assert isinstance(inbox, Inbox)
    inbox.end()
    bench.cycle()
    assert (bench.going, bench.mode) == (True, Mode.RETRACT)
    bench.until(lambda: not bench.going)
    assert bench.mode is Mode.SAFE
    assert bench.force.true_N == 0


def test_notes_resets_and_leave_are_answered_and_a_lease_is_not(bench: Linked) -> None:
    numbers = [bench.mine.send(message) for message in (Note(code="a", text="b"), Reset())]
    bench.mine.send(Lease(attending=True))
    bench.cycles(5)
    assert bench.replies() == [Answer(to=number) for number in numbers]
    assert bench.going
    bench.mine.send(Shutdown())
    bench.cycles(1)
    assert not bench.going


@pytest.mark.parametrize(
    "frame",
    [
        encode(9, Run.TYPE, b"not json"),
        encode(9, Run.TYPE, b'{"program": {"name": "x", "steps": []}}'),
        encode(9, 250, b"{}"),
        encode(9, Run.TYPE, b" " * 400_001),
        encode(9, Run.TYPE, b'{"program": ' + b"[" * 5000),
    ],
)
def test_a_message_that_is_none_is_refused_counted_and_noted_and_the_loop_cycles_on(
    bench: Linked, frame: bytes
) -> None:
    while frame:
        try:
            frame = frame[bench.raw.send(frame) :]
        except BlockingIOError:
            bench.cycles(1)
    bench.cycles(20)
    (answer,) = bench.replies()
    assert isinstance(answer, Answer)
    assert (answer.to, bool(answer.refused)) == (9, True)
    assert bench.theirs.refused == 1
    assert [event.text for event in bench.ring.events if event.code == "refused"] == [
        "1 messages to the loop were not understood so far"
    ]
    number = bench.mine.send(Run(program=Program(name="zero", steps=(ZERO,))))
    bench.wait(0.5)
    assert Answer(to=number) in bench.replies()


def test_noise_on_the_channel_does_not_renew_the_lease(bench: Linked) -> None:
    bench.mine.send(Lease(attending=True))
    bench.cycles(2)
    heard_ns = cast(Inbox, bench.loop._commands).heard_ns
    bench.raw.send(b"noise" * 50)
    bench.cycles(20)
    assert cast(Inbox, bench.loop._commands).heard_ns == heard_ns
    assert bench.theirs.refused > 0


def test_a_flood_of_noise_costs_no_cycle(bench: Linked) -> None:
    before = len(bench.ring.loop)
    bench.raw.send(b"\x00" * 60_000)
    bench.cycles(10)
    assert len(bench.ring.loop) == before + 10
