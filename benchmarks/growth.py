"""How time and memory grow: ``python -m benchmarks.growth [--quick] [--figures FOLDER]``.

Trials, samples, sessions, vertices and clients, each from few to many; a picture each, and the slope of log cost over
log size with its 95 % interval. Constant costs make a slope too small: it is taken on the three largest sizes.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import linregress, t

LINEAR = 1.0
SLACK = 0.1  # caches that overflow and allocations make a linear cost grow by so much more


@dataclass(frozen=True)
class Curve:
    """Cost over size: seconds, and MB of a fresh process at its largest."""

    name: str
    sizes: tuple[float, ...]
    seconds: tuple[float, ...]
    MB: tuple[float, ...]

    def slope(self, values: Sequence[float]) -> tuple[float, float]:
        """Exponent on the three largest sizes, and half of its interval."""
        first = len(self.sizes) - 3
        found = linregress(np.log(self.sizes[first:]), np.log(values[first:]))
        return float(found.slope), float(t.ppf(0.975, 1) * found.stderr)

    @property
    def is_worse_than_linear(self) -> bool:
        """Whether the exponent is above 1 beyond doubt."""
        slope, half = self.slope(self.seconds)
        return slope - half > LINEAR and slope > LINEAR + SLACK


def work_fit(folder: Path, size: int) -> None:
    """`rig fit` of a session of ``size`` trials."""
    from api.operations.fit import fit  # noqa: PLC0415
    from controller.operation import Operation  # noqa: PLC0415
    from mock_devices.testing.made.synthetic import Bench, write_made_session  # noqa: PLC0415

    cycles = Bench(rate_Hz=250.0).cycles(trials=size // 2, speeds_mm_s=(10.0, 20.0))
    place = write_made_session(folder / "session", cycles)
    told(lambda: fit(Operation("fit"), [place], folder / "out", drawn=False))


def work_read(folder: Path, size: int) -> None:
    """One recording of ``size`` seconds of force at 1 kHz, read."""
    from rig.channels import FORCE, ForceSample  # noqa: PLC0415
    from rig.recording.mcap_file import RecordingWriter  # noqa: PLC0415
    from rig.recording.reader import read_recording  # noqa: PLC0415

    writer = RecordingWriter(folder / "long.mcap", {"trial": {}})
    for number in range(1000 * size):
        at = 1_000_000_000 + 1_000_000 * number
        sample = ForceSample(number, at, at, 0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 25.0, 0, 1)
        writer.add(FORCE.id, FORCE.pack(sample))
    writer.finish({"outcome": "done"})
    told(lambda: read_recording(folder / "long.mcap"))


def work_cohort(folder: Path, size: int) -> None:
    """A cohort of ``size`` sessions, in this process."""
    from api.operations.cohort.wanted import Wanted  # noqa: PLC0415
    from benchmarks.cohort import made, timed  # noqa: PLC0415

    os.environ["XDG_CACHE_HOME"] = str(folder / "kept")
    places = made(folder / "sessions", size)
    told(lambda: timed(places, folder / "out", Wanted("fit"), serial=True))


def work_lattice(_folder: Path, size: int) -> None:
    """Twenty forces of a lattice of ``size`` thousand vertices."""
    from benchmarks.lattice import shaken  # noqa: PLC0415
    from rig.tissue.lattice.block import Block  # noqa: PLC0415
    from rig.tissue.lattice.springs import Springs  # noqa: PLC0415

    across = 2 * round((1000 * size / 40) ** 0.5 / 2) + 1
    lattice = shaken(Block((across, across, 40)), Springs(0.1))
    lattice.force()
    told(lambda: [lattice.force() for _ in range(20)])


def work_clients(folder: Path, size: int) -> None:
    """``size`` clients of the service, each asking twenty times for the jobs."""
    from fastapi.testclient import TestClient  # noqa: PLC0415

    from api.http import app  # noqa: PLC0415
    from api.http.service import Service  # noqa: PLC0415
    from rig.config.wiring import Wiring  # noqa: PLC0415

    with TestClient(app.build(Service(Wiring(), folder / "sessions", Path("examples")))) as client:
        client.get("/api/v1/openapi.json")

        def ask(_number: int) -> None:
            for _ in range(20):
                client.get("/api/v1/jobs")

        with ThreadPoolExecutor(size) as pool:
            told(lambda: list(pool.map(ask, range(size))))


WORKS = {"trials": work_fit, "samples": work_read, "sessions": work_cohort, "vertices": work_lattice,
         "clients": work_clients}  # fmt: skip
UNITS = {"trials": "trials", "samples": "seconds at 1 kHz", "sessions": "sessions", "vertices": "thousand vertices",
         "clients": "clients"}  # fmt: skip
SIZES: Mapping[str, Sequence[int]] = {
    "trials": (10, 30, 100, 250, 500), "samples": (30, 120, 450, 1200, 3600), "sessions": (2, 6, 12, 25, 50),
    "vertices": (25, 60, 150, 400, 1000), "clients": (1, 2, 4, 8, 16),
}  # fmt: skip
QUICK: Mapping[str, Sequence[int]] = {
    "trials": (10, 20, 40, 80), "samples": (15, 60, 120, 240), "sessions": (2, 4, 8, 12),
    "vertices": (25, 60, 150, 400), "clients": (1, 2, 4, 8),
}  # fmt: skip


def told(work: object) -> None:
    """Runs ``work`` and prints the seconds of processor it took and the largest memory of this process in MB."""
    assert callable(work)
    began, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    work()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(json.dumps([time.process_time() - began, max(peak, before) / 1000.0]))


def measured(name: str, sizes: Sequence[int]) -> Curve:
    """One curve, a fresh process for each size."""
    found = [_once(name, size) for size in sizes]
    return Curve(name, tuple(map(float, sizes)), *zip(*found, strict=True))


def _once(name: str, size: int) -> tuple[float, float]:
    command = [sys.executable, "-m", "benchmarks.growth", "--once", name, str(size)]
    # As `rig` has it: threads of linear algebra that wait for one another would count as work.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    text = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    seconds, peak_MB = json.loads(text.splitlines()[-1])
    return float(seconds), float(peak_MB)


def draw(curve: Curve, file: Path) -> None:
    """Time and memory over size, both logarithmic."""
    from rig.report.drawing import dress, new_figure, png  # noqa: PLC0415
    from rig.report.ink import ACTUAL, MODEL  # noqa: PLC0415

    figure = new_figure(7.0, 3.4)
    panels = figure.subplots(1, 2)
    for axes, values, unit, color in zip(panels, (curve.seconds, curve.MB), ("s", "MB"), (ACTUAL, MODEL), strict=True):
        slope, _ = curve.slope(values)
        dress(axes, f"{curve.name}: exponent {slope:.2f}", UNITS[curve.name], unit)
        axes.loglog(curve.sizes, values, "o-", color=color, markersize=5)
    file.write_bytes(png(figure, dpi=90))


def main() -> None:
    """Prints each curve; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller sizes, in two minutes")
    parser.add_argument("--figures", type=Path, help="folder for a picture of each curve")
    parser.add_argument("--only", choices=WORKS, action="append", help="may be repeated")
    parser.add_argument("--once", nargs=2, metavar=("NAME", "SIZE"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.once:
        with tempfile.TemporaryDirectory() as folder:
            WORKS[options.once[0]](Path(folder), int(options.once[1]))
        return
    result: dict[str, object] = {}
    for name in options.only or WORKS:
        curve = measured(name, (QUICK if options.quick else SIZES)[name])
        result[name] = _said(curve)
        if options.figures is not None:
            options.figures.mkdir(parents=True, exist_ok=True)
            draw(curve, options.figures / f"growth-{name}.png")
    print(json.dumps(result))


def _said(curve: Curve) -> dict[str, object]:
    (slope, half), (memory, _) = curve.slope(curve.seconds), curve.slope(curve.MB)
    worse = "worse than linear" if curve.is_worse_than_linear else "no worse than linear"
    last = f"{curve.sizes[-1]:g} {UNITS[curve.name]}: {curve.seconds[-1]:.2f} s, {curve.MB[-1]:.0f} MB"
    print(f"{curve.name:9} time ~ size^{slope:.2f} (95 %: +- {half:.2f}), memory ~ size^{memory:.2f}; {last}; {worse}")
    return {
        "exponent": slope, "half_interval": half, "memory_exponent": memory, "sizes": curve.sizes,
        "seconds": curve.seconds, "MB": curve.MB, "linear": not curve.is_worse_than_linear,
    }  # fmt: skip


if __name__ == "__main__":
    main()
