"""Speed of the lattice, as ratios within one run: ``python -m benchmarks.lattice [--figure FILE] [--part NAME]``.

The alternatives taichi and warp-lang are timed if installed (``uv pip install taichi warp-lang``); numpy always is.
Every ratio states what it compares; what is extrapolated says so.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from benchmarks import lattice_euler
from benchmarks.lattice_alternatives import NumpySlices, taichi_force, warp_force
from benchmarks.lattice_portable import TunedNumpy, multiply_add, portable_c, triad
from mock_devices.testing.made.lattice_reference import untied
from rig.tissue.lattice import fire
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.kernels import STEPS
from rig.tissue.lattice.numba_types import Matrix
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import RELATIVE_TOLERANCE, sweep

EXPONENT = 4.0
DEPTH_MM = 2.0
TOLERANCE_N = RELATIVE_TOLERANCE * 0.1
GUESSES_PER_FORCE, FORCES = 4, 10
STATE_ARRAYS = 7  # positions, rest, force, free, and the solver's velocity, inverse mass and diagonal
ALTERNATIVES: Mapping[str, Callable[[Matrix, float, float], Callable[[], Matrix] | None]] = {
    "numpy slices": NumpySlices,
    "tuned numpy": TunedNumpy,
    "portable C": portable_c,
    "taichi": taichi_force,
    "warp": warp_force,
}
FLOPS = {"constant": 20, "exponential": 45}  # per spring, counting square root, division and both ends
MOVED_BYTES = 2 * 3 * 8  # per vertex: each position read and each force written once, the least that any order takes
FIRST_CALL = (
    "import time\nt = time.perf_counter()\n"
    "from rig.tissue.lattice.block import Block\nfrom rig.tissue.lattice.springs import Springs\n"
    "from rig.tissue.lattice.state import Loaded\nLoaded(Block(), Springs()).force()\n"
    "print(time.perf_counter() - t, time.process_time())"
)


def best(call: Callable[[], object], repeats: int) -> float:
    """Least time of ``repeats`` calls in s: what the code takes when nothing else runs in between."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def best_of_rounds(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Least time in s of each call, taken in turns: what else runs on the machine then meets all alike."""
    found = dict.fromkeys(calls, float("inf"))
    for _ in range(rounds):
        for name, call in calls.items():
            call()
            found[name] = min(found[name], best(call, 2))
    return found


def shaken(block: Block, springs: Springs) -> Loaded:
    """A lattice off its rest, so that no spring is special; without the ties of the tip's edge, which no rival has."""
    lattice = untied(Loaded(block, springs))
    inner = block.inner(lattice.x)
    inner += np.random.default_rng(0).normal(0.0, 0.05 * block.spacing_mm, inner.shape)
    return lattice


def springs_of(block: Block) -> int:
    """Number of springs in the whole block."""
    return sum(int(np.prod([n - abs(int(d)) for n, d in zip(block.nodes, step, strict=True)])) for step in STEPS)


def force_table(rounds: int) -> dict[str, dict[str, float]]:
    """ms per force evaluation of the study's full block, both laws, alternatives where installed."""
    found: dict[str, dict[str, float]] = {}
    for law, b in (("constant", 0.0), ("exponential", EXPONENT)):
        lattice, alone = shaken(Block(), Springs(0.1, b, 0.0)), shaken(Block(), Springs(0.1, b, 0.0))
        alone.slabs = 1
        with_cells = shaken(Block(), Springs(0.1, b, 1.0))
        inner = np.ascontiguousarray(lattice.block.inner(lattice.x))
        ours = lattice.block.inner(lattice.force()).copy()
        calls: dict[str, Callable[[], object]] = {"ours": lattice.force}
        for name, make in ALTERNATIVES.items():
            alternative = make(inner, 0.1, b)
            if alternative is not None:
                np.testing.assert_allclose(alternative(), ours, atol=1e-9)
                calls[name] = alternative
        calls |= {"ours, 1 thread": alone.force, "ours, with cell volumes": with_cells.force}
        times = best_of_rounds(calls, rounds)
        found[law] = {name: 1e3 * value for name, value in times.items()}
    return found


def roofline() -> tuple[float, float]:
    """Gflop/s of multiply-adds from registers, and GB/s between memory and processor, both on all cores."""
    values, (a, b, c) = np.ones(64 * 256), np.ones((3, 4_000_000))
    times = best_of_rounds({"fma": lambda: multiply_add(values, 4000), "triad": lambda: triad(a, b, c)}, 10)
    return 2e-9 * values.size * 4000 / times["fma"], 24e-9 * a.size / times["triad"]


def eased(block: Block, springs: Springs) -> Loaded:
    """The tip at 2 mm over a smooth first guess: the same start for every solver, and a kind one for the study's."""
    lattice = Loaded(block, springs)
    x, y, z = lattice.rest
    near = np.exp(-(x**2 + y**2) / 5.0**2) * (z / block.height_mm) ** 2
    lattice.x[2] -= DEPTH_MM * near * lattice.free[2]
    lattice.press(DEPTH_MM)
    return lattice


def equilibria() -> dict[str, tuple[float, int, float]]:
    """Seconds, steps and reaction over k at 2 mm, springs only, all to the study's threshold on the force."""
    springs = Springs.for_mode("study", 0.1)
    found = {}
    cases: tuple[tuple[str, Block, Callable[[Loaded], int]], ...] = (
        ("study's scheme, full", Block(), lambda lattice: lattice_euler.run(lattice, lattice_euler.EulerScheme())),
        ("fire, full", Block(), lambda lattice: fire.relax(lattice, TOLERANCE_N)),
        (
            "study's scheme, quarter",
            Block(quarter=True),
            lambda lattice: lattice_euler.run(lattice, lattice_euler.EulerScheme()),
        ),
        ("fire, quarter", Block(quarter=True), lambda lattice: fire.relax(lattice, TOLERANCE_N)),
    )
    for name, block, solve in cases:
        # Loading kernels is the first call's time, told elsewhere.
        solve(eased(replace(block, nodes=(11, 11, 8)), springs))
        lattice = eased(block, springs)
        start = time.perf_counter()
        steps = solve(lattice)
        found[name] = (time.perf_counter() - start, steps, lattice.reaction_N() / 0.1)
    return found


def sweep_seconds() -> float:
    """One sweep of phi to 8 mm, from which ten k follow by division."""
    start = time.perf_counter()
    sweep(Block(quarter=True), Springs.for_mode("stabilised"), 8.0)
    return time.perf_counter() - start


def first_call_seconds() -> list[tuple[float, float]]:
    """First force of a fresh process, seconds passed and seconds of processor: without and with kernels on disk."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        found = []
        for _ in range(2):
            command = [sys.executable, "-c", FIRST_CALL]
            text = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
            passed, busy = map(float, text.split())
            found.append((passed, busy))
    return found


class Size(NamedTuple):
    """One block of the scaling: ms per force with springs alone and with cell volumes; bytes of state per vertex."""

    vertices: int
    springs_ms: float
    cells_ms: float
    bytes_per_vertex: float


def scaling(repeats: int) -> list[Size]:
    """From 10^4 to 10^6 vertices; the state is all that a solver keeps, with its padding."""
    found = []
    for nodes in ((21, 21, 24), (31, 31, 32), (51, 51, 40), (71, 71, 56), (91, 91, 80), (121, 121, 72)):
        alone, with_cells = (shaken(Block(nodes), Springs(0.1, 0.0, ratio)) for ratio in (0.0, 1.0))
        times = best_of_rounds({"alone": alone.force, "with cells": with_cells.force}, repeats)
        vertices = alone.block.vertices
        size = STATE_ARRAYS * alone.x.nbytes / vertices
        found.append(Size(vertices, 1e3 * times["alone"], 1e3 * times["with cells"], size))
    return found


def draw(points: Sequence[Size], file: Path) -> None:
    """Cost against vertex count, as a picture."""
    from rig.report.drawing import dress, label, new_figure, png  # noqa: PLC0415
    from rig.report.ink import ACTUAL, MODEL, QUIET  # noqa: PLC0415

    figure = new_figure(7.0, 4.4)
    axes = figure.subplots()
    dress(axes, "One force evaluation", "vertices", "ms")
    vertices = [p.vertices for p in points]
    for values, name, color in (
        ([p.springs_ms for p in points], "springs alone", ACTUAL),
        ([p.cells_ms for p in points], "with cell volumes", MODEL),
    ):
        axes.loglog(vertices, values, "o-", color=color, markersize=5)
        label(axes, (vertices[2], values[2]), name, color, beside="left" if color == MODEL else "below right")
    least, most = (pick(p.bytes_per_vertex for p in points) for pick in (min, max))
    text = f"state: {least:.0f} to {most:.0f} bytes a vertex"
    axes.annotate(text, (0.03, 0.94), xycoords="axes fraction", va="top", fontsize=9, color=QUIET)
    file.write_bytes(png(figure, dpi=90))


def main() -> None:
    """Run the parts asked for and print their tables; a JSON line at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figure", type=Path, help="write cost against vertex count here (png)")
    parser.add_argument("--part", choices=PARTS, action="append", help="only this; may be repeated")
    options = parser.parse_args()
    result: dict[str, object] = {}
    for part in options.part or PARTS:
        result |= PARTS[part]()
    if options.figure is not None:
        draw(cast("list[Size]", result.get("scaling") or scaling(30)), options.figure)
    print(json.dumps(result))


def _force() -> dict[str, object]:
    forces, (gflops, GB_s) = force_table(40), roofline()
    count, moved_ms = springs_of(Block()), MOVED_BYTES * Block().vertices / GB_s / 1e6
    print(f"force of {count} springs, float64, ms (least of many)")
    for law, column in forces.items():
        for name, value in column.items():
            print(f"  {law:12} {name:24} {value:8.3f}   ours is {value / column['ours']:5.1f} x as fast")
        rate = FLOPS[law] * count / column["ours"] / 1e6
        print(f"  {law:12} {rate:.0f} Gflop/s of {gflops:.0f} in multiply-adds alone: {100 * rate / gflops:.0f} %")
        share = 100 * moved_ms / column["ours"]
        print(f"  {law:12} positions and forces moved once at {GB_s:.0f} GB/s: {moved_ms:.3f} ms, {share:.0f} % of it")
    return {"force_ms": forces, "peak_gflops": gflops, "peak_GB_s": GB_s, "moved_ms": moved_ms}


def _equilibrium() -> dict[str, object]:
    settled = equilibria()
    slow = settled["study's scheme, full"][0]
    print("equilibrium at 2 mm, springs only")
    for name, (seconds, steps, reaction) in settled.items():
        print(f"  {name:26} {seconds:7.2f} s  {steps:5d} steps  R/k {reaction:.4f} mm  {slow / seconds:5.1f} x")
    swept = sweep_seconds()
    loop = FORCES * GUESSES_PER_FORCE * slow
    print(
        f"ten-force fit: sweep to 8 mm {swept:.1f} s; study's loop {loop:.0f} s (extrapolated: {FORCES} forces x "
        f"{GUESSES_PER_FORCE} simulations x {slow:.1f} s at 2 mm): {loop / swept:.0f} x"
    )
    return {"equilibrium": settled, "sweep_s": swept, "loop_s": loop}


def _first() -> dict[str, object]:
    found = first_call_seconds()
    for name, (passed, busy) in zip(("compiling once per machine", "from disk"), found, strict=True):
        print(f"first force of a fresh process, {name}: {passed:.1f} s, {busy:.1f} s of processor time")
    return {"first_call_s": found}


def _scaling() -> dict[str, object]:
    points = scaling(30)
    print("   vertices   springs alone, ms   ns/vertex   with cell volumes, ms   state, B/vertex")
    for p in points:
        each = 1e6 * p.springs_ms / p.vertices
        print(f"  {p.vertices:9d}  {p.springs_ms:18.3f}  {each:10.2f}  {p.cells_ms:22.3f}  {p.bytes_per_vertex:16.0f}")
    return {"scaling": points}


PARTS: Mapping[str, Callable[[], dict[str, object]]] = {
    "force": _force,
    "equilibrium": _equilibrium,
    "first": _first,
    "scaling": _scaling,
}


if __name__ == "__main__":
    main()
