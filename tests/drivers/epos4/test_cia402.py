"""The state walk: every state and goal by table, and a model of the drive that is led to every goal."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.epos4.cia402 import (
    STATE_WORDS,
    Control,
    Goal,
    State,
    Status,
    decode_state,
    next_controlword,
    obstacle,
    reached,
)

SHUTDOWN, SWITCH_ON, ENABLE, STOP, OFF = 0x06, 0x07, 0x0F, 0x0B, 0x00
NEXT = {
    Goal.ENABLED: {
        State.NOT_READY: OFF,
        State.SWITCH_ON_DISABLED: SHUTDOWN,
        State.READY: SWITCH_ON,
        State.SWITCHED_ON: ENABLE,
        State.ENABLED: ENABLE,
        State.QUICK_STOP: ENABLE,
        State.FAULT_REACTION: OFF,
        State.FAULT: OFF,
    },
    Goal.STOPPED: {
        State.NOT_READY: OFF,
        State.SWITCH_ON_DISABLED: OFF,
        State.READY: OFF,
        State.SWITCHED_ON: OFF,
        State.ENABLED: STOP,
        State.QUICK_STOP: STOP,
        State.FAULT_REACTION: OFF,
        State.FAULT: OFF,
    },
    Goal.DISABLED: {
        State.NOT_READY: OFF,
        State.SWITCH_ON_DISABLED: OFF,
        State.READY: OFF,
        State.SWITCHED_ON: OFF,
        State.ENABLED: SWITCH_ON,
        State.QUICK_STOP: OFF,
        State.FAULT_REACTION: OFF,
        State.FAULT: OFF,
    },
}
OTHER_BITS = st.integers(0, 0xFFFF).map(lambda bits: bits & ~0x6F)


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0000, State.NOT_READY),
        (0x0020, State.NOT_READY),
        (0x0240, State.SWITCH_ON_DISABLED),
        (0x0260, State.SWITCH_ON_DISABLED),
        (0x0231, State.READY),
        (0x0233, State.SWITCHED_ON),
        (0x0237, State.ENABLED),
        (0x9637, State.ENABLED),
        (0x0217, State.QUICK_STOP),
        (0x020F, State.FAULT_REACTION),
        (0x022F, State.FAULT_REACTION),
        (0x0208, State.FAULT),
        (0x0228, State.FAULT),
        (0x0001, State.UNKNOWN),
        (0x0003, State.UNKNOWN),
        (0x0050 | 0x07, State.UNKNOWN),
    ],
)
def test_the_states_are_read_as_cia_402_masks_them(word: int, state: State) -> None:
    assert decode_state(word) is state


@given(state=st.sampled_from(sorted(STATE_WORDS, key=str)), other=OTHER_BITS)
def test_no_other_bit_changes_the_state(state: State, other: int) -> None:
    assert decode_state(STATE_WORDS[state] | other) is state


@pytest.mark.parametrize(("goal", "state"), [(goal, state) for goal in Goal for state in STATE_WORDS])
def test_the_next_controlword_of_every_state_and_goal(goal: Goal, state: State) -> None:
    assert next_controlword(STATE_WORDS[state], goal) == NEXT[goal][state]


@given(status=st.integers(0, 0xFFFF), goal=st.sampled_from(Goal))
def test_no_status_whatever_makes_it_reset_a_fault(status: int, goal: Goal) -> None:
    assert not next_controlword(status, goal) & Control.FAULT_RESET


@given(goal=st.sampled_from(Goal), other=OTHER_BITS)
def test_an_unknown_pattern_takes_the_torque_away_and_is_named(goal: Goal, other: int) -> None:
    status = 0x01 | other
    assert next_controlword(status, goal) == OFF
    assert f"{status:#06x}" in obstacle(status, goal)


def test_only_a_fault_and_an_unknown_pattern_are_obstacles() -> None:
    blocked = {(state, goal) for state, word in STATE_WORDS.items() for goal in Goal if obstacle(word, goal)}
    assert blocked == {(State.FAULT, Goal.ENABLED)}


class ModelDrive:
    """CiA 402-2, figure of the power drive system's states, written down on its own; errors come from outside."""

    def __init__(self, state: State) -> None:
        self.state = state

    def obey(self, word: int) -> None:
        self.pass_time()
        if word & 0x80:
            self.state = State.SWITCH_ON_DISABLED if self.state is State.FAULT else self.state
        elif not word & 0x02:
            self._move(State.SWITCH_ON_DISABLED, State.READY, State.SWITCHED_ON, State.ENABLED, State.QUICK_STOP)
        elif not word & 0x04:
            self._move(State.SWITCH_ON_DISABLED, State.READY, State.SWITCHED_ON)
            self._move(State.QUICK_STOP, State.ENABLED)
        elif not word & 0x01:
            self._move(State.READY, State.SWITCH_ON_DISABLED, State.SWITCHED_ON, State.ENABLED)
        elif not word & 0x08:
            self._move(State.SWITCHED_ON, State.READY, State.ENABLED)
        else:
            self._move(State.ENABLED, State.SWITCHED_ON, State.QUICK_STOP)

    def pass_time(self) -> None:
        self._move(State.SWITCH_ON_DISABLED, State.NOT_READY)
        self._move(State.FAULT, State.FAULT_REACTION)

    def _move(self, to: State, *sources: State) -> None:
        if self.state in sources:
            self.state = to


@given(
    start=st.sampled_from(sorted(STATE_WORDS, key=str)),
    goal=st.sampled_from(Goal),
    others=st.lists(OTHER_BITS, min_size=8, max_size=8),
    fault_at=st.integers(0, 20),
)
def test_a_drive_that_is_led_arrives_or_the_obstacle_is_named(
    start: State, goal: Goal, others: list[int], fault_at: int
) -> None:
    drive = ModelDrive(start)
    for step, other in enumerate(others):
        if step == fault_at:
            drive.state = State.FAULT_REACTION
        status = STATE_WORDS[drive.state] | other
        if reached(status, goal):
            return
        if obstacle(status, goal):
            assert goal is Goal.ENABLED
            assert drive.state is State.FAULT
            return
        drive.obey(next_controlword(status, goal))
    pytest.fail(f"{goal} not reached from {start}, the drive is in {drive.state}")


@given(status=st.integers(0, 0xFFFF))
def test_a_drive_that_is_where_it_should_be_is_kept_there(status: int) -> None:
    for goal in Goal:
        if reached(status, goal):
            drive = ModelDrive(decode_state(status))
            drive.obey(next_controlword(status, goal))
            assert reached(STATE_WORDS[drive.state], goal)


def test_bits_beside_the_state_have_the_places_the_maker_gives_them() -> None:
    named = {bit.name: int(bit).bit_length() - 1 for bit in Status}
    assert named == {
        "FAULT": 3, "VOLTAGE": 4, "WARNING": 7, "REMOTE": 9, "TARGET_REACHED": 10, "INTERNAL_LIMIT": 11,
        "ACKNOWLEDGE": 12, "MODE_ERROR": 13, "REFERENCED": 15,
    }  # fmt: skip
