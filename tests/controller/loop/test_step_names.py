"""What steps call themselves and channels: the page shows the mode, and a refusal of a zero names the channel."""

from controller.loop.modes import Mode
from controller.loop.steps import CHANNELS, Approach, Compress, Retract, TrackForce


def test_each_step_says_what_the_bench_is_doing() -> None:
    shown = {step: step.mode for step in (Approach, Compress, TrackForce, Retract)}
    assert shown == {
        Approach: Mode.APPROACH, Compress: Mode.COMPRESS, TrackForce: Mode.CONTACT, Retract: Mode.RETRACT
    }  # fmt: skip


def test_channels_are_forces_then_moments_along_x_y_and_z() -> None:
    assert tuple(f"{kind}{along}" for kind in "fm" for along in "xyz") == CHANNELS
