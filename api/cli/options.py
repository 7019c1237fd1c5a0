"""Options that many commands share, and where the configuration comes from."""

import os
from pathlib import Path
from typing import Annotated

import typer

from rig.config.calibration import KINDS
from rig.config.calibration_files import with_files
from rig.config.glove_files import gloves_beside, with_gloves
from rig.config.table import load, merged, parse
from rig.config.wiring import Wiring
from rig.errors import UsageError
from rig.recording.files import refuse_unwritable

DEFAULT_FILE, EXAMPLES = Path("rig.toml"), Path("examples")
ENVIRONMENT = "RIG_CONFIG"
ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", help=f"Wiring file; else ${ENVIRONMENT}, else ./rig.toml, else the mock bench."),
]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Overrides one key; may be repeated.")
]


ModelOption = Annotated[Path, typer.Option("--model", help="model.json as `rig fit` writes it.")]
PLACE = "Session folder, one recording (.mcap), or files of any laboratory, with their mapping; a path or s3://..."
PlaceArgument = Annotated[Path, typer.Argument(help=PLACE)]
PlacesArgument = Annotated[list[Path], typer.Argument(help=f"{PLACE} Several: each by itself, in parallel.")]
MappingOption = Annotated[
    Path | None, typer.Option("--mapping", help="TOML file: what the files hold; else that beside them, or a proposal.")
]
YesOption = Annotated[bool, typer.Option("--yes", help="Takes the usual answer to every question of a proposal.")]
OnlyOption = Annotated[str, typer.Option("--only", help="Of the recordings those called so, for example 'pork*'.")]


def _checked_json(path: Path | None) -> Path | None:
    """A result that cannot be written is told before the work, not after it."""
    if path is not None:
        refuse_unwritable(path)
        if not path.absolute().parent.is_dir():
            raise UsageError(f"--json {path}: its folder does not exist; make it, or give another file")
    return path


JsonOption = Annotated[
    Path | None, typer.Option("--json", help="Writes the result to this file as JSON.", callback=_checked_json)
]


def protocols_here() -> Path:
    """./examples where that is there, else the protocols of the installed program, or of the checkout it runs from."""
    installed, checkout = Path(__file__).parents[1] / "protocols", Path(__file__).parents[2] / EXAMPLES
    return next((folder for folder in (EXAMPLES, installed) if folder.is_dir()), checkout)


def wiring_from(config: Path | None, overrides: list[str] | None) -> Wiring:
    """The wiring a command works with; without any file every port is `mock`, and that is said on stderr."""
    path = wiring_file(config)
    if path is None:
        wiring = built_in(overrides)
        if wiring.uses_mock:
            typer.echo("no wiring file given or found: working on the built-in mock bench", err=True)
        return wiring
    return _beside(load(Wiring, path, overrides or []), path.parent)


def wiring_file(config: Path | None) -> Path | None:
    """The file the wiring comes from, if any."""
    named = config or (Path(os.environ[ENVIRONMENT]) if ENVIRONMENT in os.environ else None)
    return named or (DEFAULT_FILE if DEFAULT_FILE.exists() else None)


def calibrated(wiring: Wiring) -> Wiring:
    """``wiring`` with what its calibration files hold; raises UsageError naming the file that is not as it must be."""
    return with_gloves(wiring.model_copy(update={"calibration": with_files(wiring.calibration)}))


def built_in(overrides: list[str] | None = None) -> Wiring:
    """The wiring of the mock bench: every port is `mock`."""
    return parse(Wiring, merged({}, overrides or []), "--set")


def _beside(wiring: Wiring, folder: Path) -> Wiring:
    """Paths in the file are relative to the file."""
    mock, known = wiring.mock, wiring.calibration
    mock = mock.model_copy(update={"parameters": mock.parameters and folder / mock.parameters})
    files: dict[str, Path] = {what: folder / named for what in KINDS if isinstance(named := getattr(known, what), Path)}
    wiring = wiring.model_copy(update={"mock": mock, "calibration": known.model_copy(update=files)})
    return gloves_beside(wiring, folder)
