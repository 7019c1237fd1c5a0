"""What the bench knows, and the interface for notebooks and scripts: ``rig.open("sessions/first")``.

    >>> import rig
    >>> session = rig.open("sessions/first")
    >>> session.trial("trial_1").pandas("force")
    >>> session.fit(laws=("fung",)).laws["index"].parameters["a_N_mm"].value

What stands in ``__all__`` stays as it is within a major version. Importing this package loads nothing else; what needs
numerics, Arrow or matplotlib loads them when it is called.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import RigError
from rig.version import __version__

if TYPE_CHECKING:
    from rig.notebook import SessionData, TrialData, to_pandas

__all__ = ["RigError", "SessionData", "TrialData", "__version__", "open", "to_pandas"]


def open(place: str | Path, mapping: str | Path | None = None, only: str = "") -> "SessionData":
    """The session in ``place``: its folder, one recording of it, or files of any laboratory.

    What such files hold is said by the TOML file ``mapping``, else by ``mapping.toml`` beside them, else as far as it
    can be told from them. Of the recordings those are taken whose names match the pattern ``only``. Raises DataError or
    UsageError where there is none, or something in them is wrong.
    """
    from rig.notebook import open_data  # noqa: PLC0415 - numerics and Arrow take a second to load
    from rig.trials.opening import Opening  # noqa: PLC0415

    return open_data(Path(place), Opening(Path(mapping) if mapping else None, only))


def __getattr__(name: str) -> object:
    if name in __all__:
        from rig import notebook  # noqa: PLC0415 - as above

        return getattr(notebook, name)
    raise AttributeError(f"module 'rig' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
