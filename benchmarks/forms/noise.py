"""What a force sensor adds to each reading, in forms that no autoregression of Gaussian numbers is."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# For the times of one recording [s] and a level [N]: what is added [N]. NaN: the sample was lost.
Noise = Callable[[np.random.Generator, int, float], Array]
SPIKE = 0.002  # one sample in five hundred, as on a cable that is moved


def white(rng: np.random.Generator, count: int, level_N: float) -> Array:
    """Gaussian."""
    return rng.normal(0, level_N, count)


def coloured(rng: np.random.Generator, count: int, level_N: float) -> Array:
    """White and 1/f, half the power each (Timmer and Koenig 1995)."""
    shape = np.fft.rfftfreq(count)
    shape[0] = np.inf
    lines = (rng.normal(size=len(shape)) + 1j * rng.normal(size=len(shape))) / np.sqrt(shape)
    pink = np.fft.irfft(lines, count)
    return np.asarray(level_N * np.sqrt(0.5) * (pink / pink.std() + rng.normal(size=count)))


def heavy_tailed(rng: np.random.Generator, count: int, level_N: float) -> Array:
    """Student's t with three degrees of freedom, whose variance is three."""
    return np.asarray(level_N / np.sqrt(3) * rng.standard_t(3, count))


def spiked(rng: np.random.Generator, count: int, level_N: float) -> Array:
    """White, with single samples far out."""
    hit = rng.random(count) < SPIKE
    return white(rng, count, level_N) + hit * rng.normal(0, 20 * level_N, count)


def lossy(rng: np.random.Generator, count: int, level_N: float) -> Array:
    """White, one sample in a hundred lost and 60 ms of a kilohertz at once."""
    noise = white(rng, count, level_N)
    noise[rng.random(count) < 0.01] = np.nan
    begin = int(rng.integers(0, max(count - count // 80, 1)))
    noise[begin : begin + count // 80] = np.nan
    return noise


NOISES: dict[str, Noise] = {
    "white": white, "coloured": coloured, "heavy-tailed": heavy_tailed, "outliers": spiked, "missing": lossy,
}  # fmt: skip
