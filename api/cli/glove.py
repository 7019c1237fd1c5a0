"""`rig threshold --glove`: the subject's pain threshold by three presses, without the axis."""

import json
from pathlib import Path

from api.cli.computing import here
from api.cli.mock_bench import bench_for
from api.cli.output import show, write_json
from api.operations.glove import check, threshold_alone, threshold_operation
from mock_devices.control import BenchControl
from rig.config.endpoints import Endpoints
from rig.config.glove_files import with_gloves
from rig.config.products.roles import MOCK_PORT
from rig.config.wiring import Wiring
from rig.results.glove import GloveThreshold

# What somebody does with the simulated glove, where nobody can put it on; the third press is an outlier.
MOCK_PRESSES = "8.0,8.5,13.0,7.9"


def by_glove(wiring: Wiring, name: str, out: Path, json_file: Path | None) -> None:
    """Finds it, says it, and the lines of `rig.toml` that keep it for the site."""
    known = with_gloves(wiring)
    found_name = check(known, name, out)
    operation = threshold_operation()
    with bench_for(known, approaches=False) as (live, endpoints):
        if endpoints and known.input[found_name].port == MOCK_PORT:
            _press_mock(endpoints)
        found = here(operation, lambda: threshold_alone(operation, live, found_name, out))
    _say(found, wiring)
    write_json(json_file, found)


def _press_mock(endpoints: Endpoints) -> None:
    with BenchControl(endpoints.control) as control:
        control.fault("glove", "presses", MOCK_PRESSES)


def _say(found: GloveThreshold, wiring: Wiring) -> None:
    assert found.force_N is not None
    limit_N = int(found.force_N * 10) / 10
    show(f"{found.force_N:.2f} N at {found.site} of {found.subject}: {found.rule}")
    show(f"[subject.site_thresholds_N]\n{json.dumps(found.site)} = {limit_N:.1f}")
    if limit_N > wiring.subject.pain_threshold_N:
        show(f"subject.pain_threshold_N, {wiring.subject.pain_threshold_N:g} N, holds there too until it is raised")
    show("a finger's pad presses on more skin than the tip: the same force hurts more under a tip of 6 mm")
