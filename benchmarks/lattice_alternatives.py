"""The same springs in numpy, taichi and warp, for comparison only."""

# mypy: ignore-errors
# Kernels of taichi and warp are Python by syntax alone.

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rig.tissue.lattice.kernels import STEPS

Floats = NDArray[np.float64]


class NumpySlices:
    """Nine shifted slices, each added to both ends: the usual way to write a lattice in numpy."""

    def __init__(self, inner: Floats, k: float, b: float) -> None:
        """``inner`` (3, nx, ny, nz) in mm, spacing 1 mm."""
        self._inner, self._k, self._b = inner, k, b

    def __call__(self) -> Floats:
        """Force (3, nx, ny, nz) in N."""
        force = np.zeros_like(self._inner)
        for step in STEPS:
            here = tuple(slice(max(0, -d), n - max(0, d)) for d, n in zip(step, force.shape[1:], strict=True))
            there = tuple(slice(max(0, d), n + min(0, d)) for d, n in zip(step, force.shape[1:], strict=True))
            gap = self._inner[(slice(None), *there)] - self._inner[(slice(None), *here)]
            length = np.sqrt(np.count_nonzero(step))
            r = np.sqrt((gap**2).sum(axis=0))
            k = self._k * np.exp(self._b * np.abs(r / length - 1.0)) if self._b else self._k
            pull = k * (1.0 - length / r) * gap
            force[(slice(None), *here)] += pull
            force[(slice(None), *there)] -= pull
        return force


def _neighbours() -> list[tuple[int, int, int]]:
    return [tuple(int(sign * d) for d in step) for step in STEPS for sign in (1, -1)]


def taichi_force(inner: Floats, k: float, b: float) -> Callable[[], Floats] | None:
    """Gather over 18 neighbours on two threads; None where taichi is not installed."""
    try:
        import taichi as ti  # noqa: PLC0415
    except ImportError:
        return None
    ti.init(arch=ti.cpu, cpu_max_num_threads=2, default_fp=ti.f64, log_level=ti.ERROR)
    nx, ny, nz = inner.shape[1:]
    x, f = ti.Vector.field(3, ti.f64, (nx, ny, nz)), ti.Vector.field(3, ti.f64, (nx, ny, nz))
    x.from_numpy(np.ascontiguousarray(np.moveaxis(inner, 0, -1)))
    offsets = _neighbours()

    @ti.kernel
    def run():
        for i, j, m in x:
            total = ti.Vector([0.0, 0.0, 0.0])
            for s in ti.static(range(18)):
                p, q, r = i + offsets[s][0], j + offsets[s][1], m + offsets[s][2]
                if 0 <= p < nx and 0 <= q < ny and 0 <= r < nz:
                    gap = x[p, q, r] - x[i, j, m]
                    length = ti.static(float(np.sqrt(np.count_nonzero(offsets[s]))))
                    size = gap.norm()
                    stiff = k
                    if ti.static(b > 0):
                        stiff = k * ti.exp(b * ti.abs(size / length - 1.0))
                    total += stiff * (1.0 - length / size) * gap
            f[i, j, m] = total

    run()
    answer = np.moveaxis(f.to_numpy(), -1, 0)

    def call() -> Floats:
        run()
        ti.sync()
        return answer

    return call


def warp_force(inner: Floats, k: float, b: float) -> Callable[[], Floats] | None:
    """Scatter over springs with atomic additions, warp's one CPU thread; None where warp is not installed."""
    try:
        import warp as wp  # noqa: PLC0415
    except ImportError:
        return None
    from benchmarks.lattice_warp import spring_force  # noqa: PLC0415

    wp.config.quiet = True
    shape = inner.shape[1:]
    index = np.arange(np.prod(shape)).reshape(shape)
    pairs, lengths = [], []
    for step in STEPS:
        here = tuple(slice(max(0, -d), n - max(0, d)) for d, n in zip(step, shape, strict=True))
        there = tuple(slice(max(0, d), n + min(0, d)) for d, n in zip(step, shape, strict=True))
        pairs.append(np.column_stack([index[here].ravel(), index[there].ravel()]))
        lengths.append(np.full(len(pairs[-1]), np.sqrt(np.count_nonzero(step))))
    x = wp.array(np.ascontiguousarray(inner.reshape(3, -1).T), dtype=wp.vec3d, device="cpu")
    f = wp.zeros(len(x), dtype=wp.vec3d, device="cpu")
    ends = wp.array(np.vstack(pairs).astype(np.int32), dtype=wp.vec2i, device="cpu")
    rest = wp.array(np.concatenate(lengths), dtype=wp.float64, device="cpu")

    def call() -> Floats:
        f.zero_()
        wp.launch(spring_force, dim=len(ends), inputs=[x, f, ends, rest, wp.float64(k), wp.float64(b)], device="cpu")
        return f.numpy().T.reshape(inner.shape)

    return call
