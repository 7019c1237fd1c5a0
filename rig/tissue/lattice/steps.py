"""One step of FIRE over all degrees of freedom, in compiled passes."""

import numpy as np

from rig.tissue.lattice.numba_types import Floats, sum_loop
from rig.tissue.lattice.threads import cut, in_parts

_LEAST_PART = 150_000  # values; handing out less costs more than it saves


def parts(size: int, count: int) -> list[tuple[int, int]]:
    """Ranges of ``size`` values for at most ``count`` threads, none too small to be worth handing out."""
    return cut(size, max(1, min(count, size // _LEAST_PART)))


@sum_loop
def _fire_sums(v: Floats, f: Floats, inverse_mass: Floats) -> tuple[float, float, float, float]:
    power, force2, speed2, largest = 0.0, 0.0, 0.0, 0.0
    for c in range(v.shape[0]):
        im = inverse_mass[c]
        pull = f[c] if im > 0.0 else 0.0
        power += pull * v[c]
        force2 += pull * pull * im
        speed2 += v[c] * v[c] / im if im > 0.0 else 0.0
        largest = max(largest, abs(pull))
    return power, force2, speed2, largest


@sum_loop
def _fire_move(
    x: Floats, v: Floats, f: Floats, inverse_mass: Floats, back: float, keep: float, turn: float, h: float, cap: float
) -> None:
    fastest = cap / h
    for c in range(x.shape[0]):
        old = v[c]
        speed = min(max(keep * old + turn * f[c] * inverse_mass[c], -fastest), fastest)
        v[c] = speed
        x[c] += back * old + h * speed


def fire_step(
    x: Floats, v: Floats, f: Floats, inverse_mass: Floats, control: Floats, cap: float, threads: int
) -> float:
    """One FIRE step (Bitzek 2006; half a step back when the power turns negative, Guenole 2020). Returns the largest
    force.

    ``control`` holds step h, mixing alpha, steps since the power was last negative, largest h. Masses scale the metric:
    speeds and forces are compared as sqrt(m) v and f / sqrt(m).
    """
    ranges = parts(x.size, threads)
    sums = in_parts(_fire_sums, [(v[i:j], f[i:j], inverse_mass[i:j]) for i, j in ranges])
    power, force2, speed2 = (sum(part[column] for part in sums) for column in range(3))
    largest = max(part[3] for part in sums)
    if not np.isfinite(power + force2):
        return float("nan")
    h, alpha = float(control[0]), float(control[1])
    keep, turn, back = 1.0 - alpha, 0.0, 0.0
    if power > 0.0:
        turn = alpha * np.sqrt(speed2 / force2)
        control[2] += 1.0
        if control[2] > 5.0:
            control[0], control[1] = min(1.1 * h, control[3]), 0.99 * alpha
    else:
        keep, back = 0.0, -0.5 * h
        control[0], control[1], control[2] = max(0.5 * h, 0.02 * control[3]), 0.1, 0.0
    h = float(control[0])
    moves = [(x[i:j], v[i:j], f[i:j], inverse_mass[i:j], back, keep, turn + h, h, cap) for i, j in ranges]
    in_parts(_fire_move, moves)
    return largest
