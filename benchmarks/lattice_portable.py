"""The same springs in portable C and in tuned numpy; and how fast this computer multiplies and moves numbers at all."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from rig.tissue.lattice.kernels import STEPS

Values = NDArray[np.float64]
SOURCE = r"""
#include <math.h>
#include <string.h>
static const int S[9][3] = {{0,0,1},{0,1,0},{0,1,1},{0,1,-1},{1,0,0},{1,0,1},{1,0,-1},{1,1,0},{1,-1,0}};
void force(const double *x, double *f, int nx, int ny, int nz, double k, double b) {
  long N = (long)nx * ny * nz;
  memset(f, 0, 3 * N * sizeof(double));
  for (int s = 0; s < 9; s++) {
    int di = S[s][0], dj = S[s][1], dk = S[s][2];
    double L = sqrt((double)(di * di + dj * dj + dk * dk));
    long off = ((long)di * ny + dj) * nz + dk;
    for (int i = 0; i < nx - di; i++)
      for (int j = dj < 0 ? 1 : 0; j < ny - (dj > 0); j++) {
        long row = ((long)i * ny + j) * nz;
        for (int m = dk < 0 ? 1 : 0; m < nz - (dk > 0); m++) {
          long p = row + m, q = p + off;
          double dx = x[q] - x[p], dy = x[N + q] - x[N + p], dz = x[2 * N + q] - x[2 * N + p];
          double r = sqrt(dx * dx + dy * dy + dz * dz), c = k * (1.0 - L / r);
          if (b > 0.0) c *= exp(b * fabs(r / L - 1.0));
          f[p] += c * dx; f[N + p] += c * dy; f[2 * N + p] += c * dz;
          f[q] -= c * dx; f[N + q] -= c * dy; f[2 * N + q] -= c * dz;
        }
      }
  }
}
"""


def portable_c(inner: Values, k: float, b: float) -> Callable[[], Values] | None:
    """One thread, -O3; None where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / "force.c", Path(folder) / "force.so"
        source.write_text(SOURCE)
        command = [compiler, "-O3", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"]
        subprocess.run(command, check=True, capture_output=True)
        run = ctypes.CDLL(str(library)).force
    answer = np.empty_like(inner)
    sizes = [ctypes.c_int(size) for size in inner.shape[1:]]
    places = [ctypes.c_void_p(array.ctypes.data) for array in (inner, answer)]

    def call() -> Values:
        run(*places, *sizes, ctypes.c_double(k), ctypes.c_double(b))
        return answer

    return call


class TunedNumpy:
    """Slices as the plain program has them, but every intermediate has its memory, and x, y, z go one by one."""

    def __init__(self, inner: Values, k: float, b: float) -> None:
        self._inner, self._k, self._b = inner, k, b
        self._force = np.empty_like(inner)
        self._memory = np.empty((5, inner[0].size))

    def __call__(self) -> Values:
        self._force[:] = 0.0
        for step in STEPS:
            self._add(step)
        return self._force

    def _add(self, step: NDArray[np.int64]) -> None:
        shape = self._inner.shape[1:]
        here = tuple(slice(max(0, -d), n - max(0, d)) for d, n in zip(step, shape, strict=True))
        there = tuple(slice(max(0, d), n + min(0, d)) for d, n in zip(step, shape, strict=True))
        size = [n - abs(int(d)) for d, n in zip(step, shape, strict=True)]
        *gaps, pull, scratch = (row[: np.prod(size)].reshape(size) for row in self._memory)
        for at, gap in enumerate(gaps):
            np.subtract(self._inner[at][there], self._inner[at][here], out=gap)
        self._pull(gaps, float(np.sqrt(np.count_nonzero(step))), pull, scratch)
        for at, gap in enumerate(gaps):
            np.multiply(gap, pull, out=gap)
            self._force[at][here] += gap
            self._force[at][there] -= gap

    def _pull(self, gaps: list[Values], length: float, pull: Values, scratch: Values) -> None:
        np.multiply(gaps[0], gaps[0], out=pull)
        for gap in gaps[1:]:
            np.multiply(gap, gap, out=scratch)
            pull += scratch
        np.sqrt(pull, out=pull)
        if self._b:
            np.divide(pull, length, out=scratch)
            scratch -= 1.0
            np.abs(scratch, out=scratch)
            scratch *= self._b
            np.exp(scratch, out=scratch)
        np.divide(-length, pull, out=pull)
        pull += 1.0
        pull *= self._k
        if self._b:
            pull *= scratch


@njit(fastmath=True, parallel=True)
def multiply_add(values: Values, rounds: int) -> None:
    """Two operations a value and round, from registers: nothing but multiply-adds."""
    for part in prange(values.size // 64):
        kept = values[64 * part : 64 * part + 64].copy()
        for _ in range(rounds):
            for lane in range(64):
                kept[lane] = kept[lane] * 0.999 + 0.001
        values[64 * part : 64 * part + 64] = kept


@njit(parallel=True)
def triad(a: Values, b: Values, c: Values) -> None:
    """a = b + s c: 24 bytes a value, as STREAM counts them."""
    for i in prange(a.size):
        a[i] = b[i] + 0.5 * c[i]
