"""From force detected to the surface: samples of the approach, and the estimator run on them while the axis rests.

Detection says that there is contact, and its depth grows with the sensor's noise; where contact is, the loading before
it says, extrapolated back (`rig.trials.contact`). Where that is not known well enough, the tip backs off and touches
again, slowly: ten times as many samples a millimetre, and next to no viscous force.
"""

from typing import NamedTuple

import numpy as np

from controller.loop.paired_samples import ROWS, Touch
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from rig.trials.contact import ANY_SHAPE, LIMB_SHAPE, Contact, ContactSearch, Loading

LEAST_ROWS = 8  # the estimator fits seven numbers: one row is left to tell the noise by
AIR_MM = 0.3  # of 0.5 mm between SLIP_MM and the surface, which is known to 0.2 mm
ROUNDS = 3
# Two portions are 0.2 ms of a cycle of 1 ms; a slower loop does as many more.
PORTIONS_A_MS = 2
# The guide's slip ends within 0.5 mm of a reversal; as much again shows the force in the air.
BACK_OFF_MM = 1.0
SLIP_MM = 0.5
# What lies deeper says more of the tissue than of its surface. Where less than half of the detected force is felt, the
# surface was taken for too high, as where the zero drifts.
TOUCH_MM = 4.0
FELT_SHARE = 0.5
# A limb that came nearer meanwhile: twice the force that was detected is no touch.
TOUCH_SHARE = 2.0


class Touching(NamedTuple):
    """How well contact is to be known [mm, 95 %], and how often and how fast the tip touches again for it."""

    within_mm: float
    touches: int
    speed_mm_s: float
    back_off_mm_s: float


class TouchRun:
    """Rests and estimates; backs off and touches slowly as long as that is needed and allowed."""

    def __init__(self, state: LoopState, touching: Touching, slipped: bool) -> None:
        """``slipped``: the guide had before contact."""
        self._touching = touching
        self._detected_mm, self._detected_N = state.position_mm, state.force_N
        # A loading that began before the guide had slipped holds its friction too.
        self._sound, self._slow = slipped, 0
        self._phase = self._estimate
        self._search: ContactSearch | None = None
        self._found: Contact | None = None

    def advance(self, state: LoopState) -> bool:
        """One cycle; True once the surface is known as well as it will be."""
        return self._phase(state)

    def _estimate(self, state: LoopState) -> bool:
        state.setpoint = Setpoint(state.setpoint.position_mm, 0.0)
        state.paired.collecting = False
        if self._search is None:
            self._search = _search(state.paired.loading, state.noise_N, state.round_tip)
            return self._search is None and self._settle(state, self._unknown(state))
        for _ in range(max(1, round(PORTIONS_A_MS * 1e3 * state.dt_s))):
            if self._search.advance():
                return self._settle(state, self._search.contact)
        return False

    def _unknown(self, state: LoopState) -> Contact:
        """Too few samples to tell: the place of detection, and the way the force may have begun on."""
        positions = state.paired.loading.position_mm
        low_mm = min(float(positions.min()), self._detected_mm) if len(positions) else self._detected_mm - TOUCH_MM
        return Contact(self._detected_mm, low_mm, self._detected_mm, 0.0, low_mm, self._detected_mm)

    def _settle(self, state: LoopState, contact: Contact) -> bool:
        self._found, self._search = contact, None
        known = self._sound and contact.within_mm <= self._touching.within_mm
        # Two touches without samples tell no more than one: something else is wrong, and the interval says so.
        known |= self._slow > 0 and len(state.paired.loading.samples) < LEAST_ROWS
        if not known and self._slow < self._touching.touches:
            self._phase = self._back_off
            return False
        state.surface_mm, state.memory = contact.position_mm, None
        state.touch = Touch(
            contact.position_mm, contact.low_mm, contact.high_mm,
            self._detected_mm, self._detected_N, state.paired.samples, self._slow,
        )  # fmt: skip
        return True

    def _back_off(self, state: LoopState) -> bool:
        if state.go(self._top_mm(state), self._touching.back_off_mm_s):
            if not self._slow:
                state.paired.clear()
            self._slow, self._sound = self._slow + 1, True
            self._phase = self._touch
        return False

    def _top_mm(self, state: LoopState) -> float:
        """Where a touch begins: in the air, within the workspace."""
        assert self._found
        return max(self._found.low_mm - BACK_OFF_MM, state.position_min_mm)

    def _touch(self, state: LoopState) -> bool:
        assert self._found
        state.paired.collecting = state.position_mm > self._top_mm(state) + SLIP_MM
        deep = state.position_mm >= self._found.position_mm + TOUCH_MM
        pressed = state.force_N > (FELT_SHARE if deep else TOUCH_SHARE) * self._detected_N
        if state.go(self._detected_mm, self._touching.speed_mm_s) or pressed:
            self._phase = self._estimate
        return False


def _search(loading: Loading, noise_N: float, round_tip: bool = False) -> ContactSearch | None:
    """The estimator over a loading whose first 0.3 mm is taken for air; None where there are too few rows."""
    if len(loading.samples) < LEAST_ROWS:
        return None
    first_mm, last_mm = float(loading.position_mm.min()), float(loading.position_mm.max())
    air_mm = min(AIR_MM, 0.2 * (last_mm - first_mm))
    # Force and axis are paired to a row: at its speed that is how far a force may lie from its place.
    paired = loading._replace(apart_mm=float(np.median(np.abs(np.diff(loading.position_mm)))))
    return ContactSearch(paired, (first_mm + air_mm, last_mm), noise_N, ANY_SHAPE if round_tip else LIMB_SHAPE, ROUNDS)


def warm_up(round_tip: bool = False) -> Contact:
    """Estimates a surface at 0 mm before anything moves: what a first call loads and allocates takes milliseconds.

    As many rows as an approach may leave: linear algebra takes its 64 MB of working memory only for long ones, and
    memory that is locked is filled at once, which takes 25 ms.
    """
    depth_mm = np.linspace(-1.0, 1.0, ROWS)
    search = _search(Loading(depth_mm, np.maximum(depth_mm, 0.0), np.ones_like(depth_mm)), 0.01, round_tip)
    assert search
    while not search.advance():
        pass
    return search.contact
