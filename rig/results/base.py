"""The root of all results: frozen, read from what science computed, one JSON form."""

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Self, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from rig.config.table import refuse_newer
from rig.errors import UsageError
from rig.recording.files import write_text

VERSION = 1
Value = TypeVar("Value")


def known(value: Value) -> Value | None:
    """``value``; None for NaN and infinities, which stand for what nobody knows."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


Number = Annotated[float | None, BeforeValidator(known)]
"""A number that may be unknown: NaN and infinities become None, which is null in JSON."""


class Result(BaseModel):
    """A result; fields carry their unit in the name. Objects with the same attributes are taken as they are."""

    model_config = ConfigDict(frozen=True, from_attributes=True, allow_inf_nan=False)


class SavedResult(Result):
    """A result that stands alone: what a command found, in a file or as an answer."""

    version: int = Field(default=VERSION, description="of the format of all results; files without one are older")

    def write(self, path: Path) -> None:
        """Writes the JSON, whole or not at all."""
        write_text(path, self.model_dump_json(indent=2) + "\n")

    @classmethod
    def read_or_why(cls, path: Path, never: str, command: str) -> Self | str:
        """What ``read`` reads, or a sentence for a report: ``never``, or what is wrong; and what ``command`` does."""
        try:
            return cls.read(path)
        except OSError:
            return f"{never}; `{command}` does it."
        except UsageError as error:
            return f"{error}; run `{command}` again."

    @classmethod
    def read(cls, path: Path) -> Self:
        """What ``write`` wrote; raises OSError where there is no such file, UsageError where it is another or newer."""
        text = path.read_bytes()
        with suppress(ValueError, RecursionError):  # what is no JSON is said below
            refuse_newer(json.loads(text), VERSION, str(path))
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"])) or "the file"
            raise UsageError(f"{path}: holds no {cls.__name__}: {place}: {first['msg']}") from error


class Failure(SavedResult):
    """Why a command that has no result ended: ``error`` is the kind, ``reason`` the sentence it said."""

    error: str = Field(description="class of the error, such as DataError, DeviceError, CheckFailed or SafetyStop")
    exit_code: int
    reason: str
