"""The state walk: every state and goal by table, and a model of the drive that is led to every goal."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.epos4.cia402 import (
    STATE_WORDS,
    Controlword,
    Goal,
    PdsState,
    Statusword,
    decode_state,
    next_controlword,
    obstacle,
    reached,
)

SHUTDOWN, SWITCH_ON, ENABLE, STOP, OFF = 0x06, 0x07, 0x0F, 0x0B, 0x00
NEXT = {
    Goal.ENABLED: {
        PdsState.NOT_READY: OFF,
        PdsState.SWITCH_ON_DISABLED: SHUTDOWN,
        PdsState.READY: SWITCH_ON,
        PdsState.SWITCHED_ON: ENABLE,
        PdsState.ENABLED: ENABLE,
        PdsState.QUICK_STOP: ENABLE,
        PdsState.FAULT_REACTION: OFF,
        PdsState.FAULT: OFF,
    },
    Goal.STOPPED: {
        PdsState.NOT_READY: OFF,
        PdsState.SWITCH_ON_DISABLED: OFF,
        PdsState.READY: OFF,
        PdsState.SWITCHED_ON: OFF,
        PdsState.ENABLED: STOP,
        PdsState.QUICK_STOP: STOP,
        PdsState.FAULT_REACTION: OFF,
        PdsState.FAULT: OFF,
    },
    Goal.DISABLED: {
        PdsState.NOT_READY: OFF,
        PdsState.SWITCH_ON_DISABLED: OFF,
        PdsState.READY: OFF,
        PdsState.SWITCHED_ON: OFF,
        PdsState.ENABLED: SWITCH_ON,
        PdsState.QUICK_STOP: OFF,
        PdsState.FAULT_REACTION: OFF,
        PdsState.FAULT: OFF,
    },
}
OTHER_BITS = st.integers(0, 0xFFFF).map(lambda bits: bits & ~0x6F)


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0000, PdsState.NOT_READY),
        (0x0020, PdsState.NOT_READY),
        (0x0240, PdsState.SWITCH_ON_DISABLED),
        (0x0260, PdsState.SWITCH_ON_DISABLED),
        (0x0231, PdsState.READY),
        (0x0233, PdsState.SWITCHED_ON),
        (0x0237, PdsState.ENABLED),
        (0x9637, PdsState.ENABLED),
        (0x0217, PdsState.QUICK_STOP),
        (0x020F, PdsState.FAULT_REACTION),
        (0x022F, PdsState.FAULT_REACTION),
        (0x0208, PdsState.FAULT),
        (0x0228, PdsState.FAULT),
        (0x0001, PdsState.UNKNOWN),
        (0x0003, PdsState.UNKNOWN),
        (0x0050 | 0x07, PdsState.UNKNOWN),
    ],
)
def test_the_states_are_read_as_cia_402_masks_them(word: int, state: PdsState) -> None:
    assert decode_state(word) is state


@given(state=st.sampled_from(sorted(STATE_WORDS, key=str)), other=OTHER_BITS)
def test_no_other_bit_changes_the_state(state: PdsState, other: int) -> None:
    assert decode_state(STATE_WORDS[state] | other) is state


@pytest.mark.parametrize(("goal", "state"), [(goal, state) for goal in Goal for state in STATE_WORDS])
def test_the_next_controlword_of_every_state_and_goal(goal: Goal, state: PdsState) -> None:
    assert next_controlword(STATE_WORDS[state], goal) == NEXT[goal][state]


@given(status=st.integers(0, 0xFFFF), goal=st.sampled_from(Goal))
def test_no_status_whatever_makes_it_reset_a_fault(status: int, goal: Goal) -> None:
    assert not next_controlword(status, goal) & Controlword.FAULT_RESET


@given(goal=st.sampled_from(Goal), other=OTHER_BITS)
def test_an_unknown_pattern_takes_the_torque_away_and_is_named(goal: Goal, other: int) -> None:
    status = 0x01 | other
    assert next_controlword(status, goal) == OFF
    assert f"{status:#06x}" in obstacle(status, goal)


def test_only_a_fault_and_an_unknown_pattern_are_obstacles() -> None:
    blocked = {(state, goal) for state, word in STATE_WORDS.items() for goal in Goal if obstacle(word, goal)}
    assert blocked == {(PdsState.FAULT, Goal.ENABLED)}


class ModelDrive:
    """CiA 402-2, figure of the power drive system's states, written down on its own; errors come from outside."""

    def __init__(self, state: PdsState) -> None:
        self.state = state

    def obey(self, word: int) -> None:
        self.pass_time()
        if word & 0x80:
            self.state = PdsState.SWITCH_ON_DISABLED if self.state is PdsState.FAULT else self.state
        elif not word & 0x02:
            self._move(
                PdsState.SWITCH_ON_DISABLED,
                PdsState.READY,
                PdsState.SWITCHED_ON,
                PdsState.ENABLED,
                PdsState.QUICK_STOP,
            )
        elif not word & 0x04:
            self._move(PdsState.SWITCH_ON_DISABLED, PdsState.READY, PdsState.SWITCHED_ON)
            self._move(PdsState.QUICK_STOP, PdsState.ENABLED)
        elif not word & 0x01:
            self._move(PdsState.READY, PdsState.SWITCH_ON_DISABLED, PdsState.SWITCHED_ON, PdsState.ENABLED)
        elif not word & 0x08:
            self._move(PdsState.SWITCHED_ON, PdsState.READY, PdsState.ENABLED)
        else:
            self._move(PdsState.ENABLED, PdsState.SWITCHED_ON, PdsState.QUICK_STOP)

    def pass_time(self) -> None:
        self._move(PdsState.SWITCH_ON_DISABLED, PdsState.NOT_READY)
        self._move(PdsState.FAULT, PdsState.FAULT_REACTION)

    def _move(self, to: PdsState, *sources: PdsState) -> None:
        if self.state in sources:
            self.state = to


@given(
    start=st.sampled_from(sorted(STATE_WORDS, key=str)),
    goal=st.sampled_from(Goal),
    others=st.lists(OTHER_BITS, min_size=8, max_size=8),
    fault_at=st.integers(0, 20),
)
def test_a_drive_that_is_led_arrives_or_the_obstacle_is_named(
    start: PdsState, goal: Goal, others: list[int], fault_at: int
) -> None:
    drive = ModelDrive(start)
    for step, other in enumerate(others):
        if step == fault_at:
            drive.state = PdsState.FAULT_REACTION
        status = STATE_WORDS[drive.state] | other
        if reached(status, goal):
            return
        if obstacle(status, goal):
            assert goal is Goal.ENABLED
            assert drive.state is PdsState.FAULT
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
    named = {bit.name: int(bit).bit_length() - 1 for bit in Statusword}
    assert named == {
        "FAULT": 3, "VOLTAGE": 4, "WARNING": 7, "REMOTE": 9, "TARGET_REACHED": 10, "INTERNAL_LIMIT": 11,
        "ACKNOWLEDGE": 12, "MODE_ERROR": 13, "REFERENCED": 15,
    }  # fmt: skip
