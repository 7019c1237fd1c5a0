"""From the three force channels of a sensor to compression: one channel, one sign, one matrix, in one place."""

from typing import Any, Literal, NamedTuple

ForceChannel = Literal["fx", "fy", "fz"]
Sign = Literal["positive", "negative"]
Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Wrench = tuple[float, float, float, float, float, float]

CHANNELS: tuple[ForceChannel, ...] = ("fx", "fy", "fz")
UNIT: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class ForceMap(NamedTuple):
    """``matrix`` turns readings Fx Fy Fz [N] into forces in the sensor's frame; unit where nobody calibrated.

    Compression lies along ``channel`` and shows there with the sign ``compression``. Everything here is linear: a zero
    may be taken off before or after. Forces are numbers or numpy arrays of one shape.
    """

    channel: ForceChannel = "fz"
    compression: Sign = "negative"
    matrix: Matrix = UNIT

    @property
    def sign(self) -> float:
        """Of compression on its channel."""
        return 1.0 if self.compression == "positive" else -1.0

    @property
    def weights(self) -> Vector:
        """What each of the three readings counts in compression."""
        x, y, z = self.matrix[CHANNELS.index(self.channel)]
        return self.sign * x, self.sign * y, self.sign * z

    def compression_N(self, fx_N: Any, fy_N: Any, fz_N: Any) -> Any:
        """Compressive force [N]; a channel that counts nothing may hold anything, NaN included."""
        counted = zip(self.weights, (fx_N, fy_N, fz_N), strict=True)
        return sum(weight * force_N for weight, force_N in counted if weight)

    def force_N(self, fx_N: Any, fy_N: Any, fz_N: Any) -> tuple[Any, Any, Any]:
        """Force vector [N] in the sensor's frame."""
        x, y, z = (row[0] * fx_N + row[1] * fy_N + row[2] * fz_N for row in self.matrix)
        return x, y, z

    def wrench(self, reading: Wrench) -> Wrench:
        """Force vector [N] as ``force_N`` has it, and the three moments [N m] as they were read."""
        (fx_N, fy_N, fz_N), (mx_N_m, my_N_m, mz_N_m) = self.force_N(*reading[:3]), reading[3:]
        return fx_N, fy_N, fz_N, mx_N_m, my_N_m, mz_N_m
