"""Options that many commands share, and where the configuration comes from."""

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.config.table import load, merged, parse
from rig.config.wiring import Wiring

DEFAULT_FILE = Path("rig.toml")
ENVIRONMENT = "RIG_CONFIG"
# A simulated device is one more process of a busy computer: without real-time priority it may come a few tenths of a
# second late where a real one does not. An axis that stands still for 400 ms falls behind by 12 mm at 30 mm/s.
PATIENT = {
    "loop": {
        "missed_periods": 0,
        "stale_force_ms": 400,
        "stale_axis_ms": 400,
        "stale_marker_ms": 500,
        "overrun_ms": 400,
    },
    "axis": {"heartbeat_ms": 200, "following_error_mm": 12},
}

ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", help=f"Wiring file; else ${ENVIRONMENT}, else ./rig.toml, else the mock bench."),
]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", help="Overrides one key: section.key=value; may be repeated.")
]
JsonOption = Annotated[Path | None, typer.Option("--json", help="Writes the result to this file as JSON.")]


def wiring_from(config: Path | None, overrides: list[str] | None) -> Wiring:
    """The wiring a command works with; without any file every port is `mock`, and that is said on stderr."""
    named = config or (Path(os.environ[ENVIRONMENT]) if ENVIRONMENT in os.environ else None)
    path = named or (DEFAULT_FILE if DEFAULT_FILE.exists() else None)
    if path is None:
        wiring = built_in(overrides)
        if wiring.uses_mock:
            typer.echo("no wiring file given or found: working on the built-in mock bench", err=True)
        return wiring
    return _beside(load(Wiring, path, overrides or []), path.parent)


def built_in(overrides: list[str] | None = None) -> Wiring:
    """The wiring of the mock bench, as patient with its pseudo-terminals as a busy computer makes necessary."""
    values: dict[str, Any] = {section: dict(table) for section, table in PATIENT.items()}
    return parse(Wiring, merged(values, overrides or []), "--set")


def _beside(wiring: Wiring, folder: Path) -> Wiring:
    """Paths in the file are relative to the file."""
    if wiring.mock.parameters is None or wiring.mock.parameters.is_absolute():
        return wiring
    mock = wiring.mock.model_copy(update={"parameters": folder / wiring.mock.parameters})
    return wiring.model_copy(update={"mock": mock})
