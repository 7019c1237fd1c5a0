"""Whether the force loop oscillates: tissue that is stiffer than it tolerates makes it swing by itself, and goes on so.

Counted are half waves of the force's error, less its slow mean, one after the other beyond ``amplitude_N`` on either
side, each as long as half a turn in the band. Breathing, limbs, tremor of muscles (8 to 12 Hz) and references are
slower than the band; what the reference itself does within it is added to the amplitude; a jump rings for a turn.
"""

import math

from controller.loop.state import LoopState

# Above physiological tremor and the fastest reference of the study (10 Hz); an unstable loop swings where its phase is
# -180 degrees: 80 Hz with a sensor of 1 kHz, 20 Hz with one of 100 Hz.
LOWEST_HZ, HIGHEST_HZ = 12.0, 200.0
# Twice what stands still may sway by where dry friction sticks (0.1 N); of a noisy sensor six standard deviations, as
# feedback passes on half of its noise.
LEAST_N, NOISES = 0.2, 6.0
# Six turns: 75 ms at 80 Hz, half a second at 12 Hz. A jump on tissue four times as stiff as the model rings for two.
HALF_WAVES = 12
MEAN_S = 0.03  # a third of the longest turn: what is slower is taken off
FADING_S = 0.1  # a turn of the slowest: the reference's own motion counts until then


class OscillationMonitor:
    """``update`` is called once a cycle while the force loop runs, ``begin`` before."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Nothing swings yet."""
        self._error_mean_N = self._reference_mean_N = math.nan
        self._asked_N = self._since_s = 0.0
        self._side = self._half_waves = 0

    def update(self, state: LoopState) -> str:
        """A sentence where it oscillates, "" where it does not, or no force is asked for."""
        error_N = state.force_N - state.reference_N
        if not math.isfinite(error_N):
            self.begin()
            return ""
        self._count(self._swing_N(error_N, state), self.amplitude_N(state), state.dt_s)
        if self._half_waves < HALF_WAVES:
            return ""
        return (
            f"the force swings by itself, {HALF_WAVES // 2} turns by more than {self.amplitude_N(state):.2f} N at"
            f" {LOWEST_HZ:g} Hz or faster: the tissue is stiffer than the force loop tolerates"
        )

    def amplitude_N(self, state: LoopState) -> float:
        """What a half wave must pass."""
        return max(LEAST_N, NOISES * state.noise_N) + self._asked_N

    def _swing_N(self, error_N: float, state: LoopState) -> float:
        """The error less its slow mean; notes how the reference moves."""
        if math.isnan(self._error_mean_N):
            self._error_mean_N, self._reference_mean_N = error_N, state.reference_N
        share = state.dt_s / (state.dt_s + MEAN_S)
        self._error_mean_N += share * (error_N - self._error_mean_N)
        self._reference_mean_N += share * (state.reference_N - self._reference_mean_N)
        fading = state.dt_s / FADING_S
        self._asked_N = max(abs(state.reference_N - self._reference_mean_N), self._asked_N * (1.0 - fading))
        return error_N - self._error_mean_N

    def _count(self, swing_N: float, amplitude_N: float, dt_s: float) -> None:
        self._since_s += dt_s
        side = 0 if abs(swing_N) <= amplitude_N else 1 if swing_N > 0 else -1
        if side in (0, self._side):
            return
        in_band = self._side != 0 and 0.5 / HIGHEST_HZ <= self._since_s <= 0.5 / LOWEST_HZ
        self._half_waves = self._half_waves + 1 if in_band else 0
        self._side, self._since_s = side, 0.0
