"""What steps call themselves and channels: the page shows the mode, and a refusal of a zero names the channel."""

from controller.loop import steps
from controller.loop.modes import Mode


def test_each_step_says_what_the_bench_is_doing() -> None:
    shown = {step: step.mode for step in (steps.Zero, steps.Approach, steps.Compress, steps.TrackForce, steps.Retract)}
    assert shown == {
        steps.Zero: Mode.FREE,
        steps.Approach: Mode.APPROACH,
        steps.Compress: Mode.COMPRESS,
        steps.TrackForce: Mode.CONTACT,
        steps.Retract: Mode.RETRACT,
    }


def test_channels_are_forces_then_moments_along_x_y_and_z() -> None:
    assert tuple(f"{kind}{along}" for kind in "fm" for along in "xyz") == steps.CHANNELS
