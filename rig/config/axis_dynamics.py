"""How an axis follows its set-point, as `rig calibrate axis --dynamics` found it, and how sure that is.

    position(s) / set-point(s) = gain exp(-s delay) / ((1 + s lag1) (1 + s lag2))

from the moment at which the loop looks at its inputs to the encoder, and from the tip to the loop what the force sensor
adds: its filter, as its product declares it, and how old its newest sample is when the loop looks, as it was measured.
"""

from typing import Annotated

from pydantic import AwareDatetime, Field

from rig.config.axis_response import AxisResponse
from rig.config.table import Table

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]

# The millisecond of delay that the force law keeps to spare; of delay and lags together, which is what the phase at its
# crossover comes from, half of it.
LARGEST_DELAY_WITHIN_S, LARGEST_TOTAL_WITHIN_S = 0.001, 0.0005
# Up to the axis' bandwidth an encoder counts a thirtieth of the swing or less, and a computer that sends 0.1 ms late
# adds as much: hundredths of the power. Where it is a tenth, something else than the axis is seen.
LEAST_COHERENCE = 0.9
# A phase of 6 degrees, an eighth of the margin of 45 that the law keeps.
LARGEST_MISFIT = 0.1
# A drive follows its set-point to its following error at rest; 5 % are another scale, or a drive that limits itself.
LARGEST_GAIN_ERROR = 0.05


class TimeEstimate(Table):
    """A time, and half of its 95 % interval."""

    s: NotNegative
    within_s: NotNegative

    def __str__(self) -> str:
        return f"{1e3 * self.s:.2f} +- {1e3 * self.within_s:.2f} ms"


class Reversal(Table):
    """What dry friction does where a slow motion turns: motion that is lost, and current that turns its sign."""

    lost_mm: float = Field(description="half of the band between both ways, less what the lags explain")
    lost_within_mm: NotNegative = Field(description="half of its 95 % interval")
    friction_A: float | None = Field(
        description="half of the difference of the drive's current between both ways; null where it tells none"
    )
    friction_within_A: NotNegative | None = Field(description="half of its 95 % interval")


class AxisDynamics(Table):
    """The fit, what was measured with, and for which loop on which computer it holds."""

    version: int = Field(default=1, description="of the file's format")
    product: Annotated[str, Field(min_length=1)]
    serial: str
    date: AwareDatetime
    computer: Annotated[str, Field(min_length=1)] = Field(description="host name and a digest of the machine's number")
    rate_Hz: Positive = Field(description="cycles a second of the loop")
    force_product: str = Field(description="the force sensor whose samples were looked at meanwhile")
    gain: float
    delay: TimeEstimate
    lag1: TimeEstimate
    lag2: TimeEstimate
    total: TimeEstimate = Field(description="delay and lags together, which are known better than each")
    reversal: Reversal
    lowest_Hz: Positive
    highest_Hz: Positive
    coherence: Share = Field(description="lowest of all frequencies up to axis.bandwidth_Hz, over the repeats")
    misfit: NotNegative = Field(description="rms of measured over fitted response, less 1")
    force_filter_s: NotNegative = Field(description="of the sensor, as its product declares it")
    force_age_s: NotNegative = Field(description="of the newest force sample when the loop looks, mean")

    @property
    def hold_s(self) -> float:
        """A set-point stands for one cycle, so that on average it is half of one old."""
        return 0.5 / self.rate_Hz

    @property
    def response(self) -> AxisResponse:
        """As a force law takes it: from a look at the force to the force sensed, and to the tip."""
        delay_s = self.delay.s + self.hold_s
        tip_lag_s = delay_s + self.lag1.s + self.lag2.s
        return AxisResponse(delay_s + self.force_filter_s + self.force_age_s, self.lag1.s, self.lag2.s, tip_lag_s)

    @property
    def doubts(self) -> list[str]:
        """Why it says too little of the axis, one sentence each with number and bound."""
        whose = f"the dynamics of {self.product} {self.serial}"
        again = "run `rig calibrate axis --dynamics` again on a computer that does nothing else"
        found = []
        if abs(self.gain - 1) > LARGEST_GAIN_ERROR:
            found.append(f"{whose} have a gain of {self.gain:.3g} (bounds 1 +- {LARGEST_GAIN_ERROR:g}): {again}")
        if self.coherence < LEAST_COHERENCE:
            found.append(f"{whose} are coherent to {self.coherence:.2f} only (bound {LEAST_COHERENCE:g}): {again}")
        if self.misfit > LARGEST_MISFIT:
            found.append(
                f"{whose} are no delay and two lags: {100 * self.misfit:.1f} % off (bound {100 * LARGEST_MISFIT:g} %)"
            )
        for what, one, most_s in (
            ("delay", self.delay, LARGEST_DELAY_WITHIN_S), ("delay and lags", self.total, LARGEST_TOTAL_WITHIN_S),
        ):  # fmt: skip
            if one.within_s > most_s:
                found.append(f"{whose}: {what} {one} (bound +- {1e3 * most_s:g} ms): {again}")
        return found

    def elsewhere(self, computer: str, rate_Hz: float, force_product: str) -> list[str]:
        """Why it does not hold for this loop, one sentence each."""
        whose, again = f"the dynamics of {self.product} {self.serial}", "run `rig calibrate axis --dynamics` here"
        found = []
        if self.computer != computer:
            found.append(f"{whose} were identified on {self.computer}, this is {computer}: {again}")
        if self.rate_Hz != rate_Hz:
            found.append(f"{whose} were identified at {self.rate_Hz:g} Hz, loop.rate_Hz is {rate_Hz:g}: {again}")
        if self.force_product != force_product:
            found.append(
                f"{whose} were identified beside a {self.force_product}, force.product is {force_product}: {again}"
            )
        return found
