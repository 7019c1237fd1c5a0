"""What a replay decided, and where that is not what was recorded."""

from typing import Annotated

from pydantic import Field

from rig.results.base import Result, SavedResult

Text = Annotated[str, Field(description="as it stands in the row")]


class ReplayDifference(Result):
    """One value of one row."""

    row: int = Field(description="of the loop stream, from 0")
    time_s: float = Field(description="since the first row")
    field: str
    recorded: Text
    replayed: Text

    @property
    def sentence(self) -> str:
        """For a person."""
        return f"row {self.row} ({self.time_s:.3f} s): {self.field} was {self.recorded} and is {self.replayed}"


class ReplayedRecording(Result):
    """One recording."""

    recording: str
    rows: int
    compared: int = Field(description="rows from the beginning of the program on")
    given: tuple[str, ...] = Field(description="inputs that no sample holds, taken from the stop that followed them")
    stops: tuple[str, ...] = Field(description="stops that the loop decided on, each with its code")
    differing_rows: int
    differences: tuple[ReplayDifference, ...] = Field(description="the first of them")


class ReplayResult(SavedResult):
    """All recordings of a session."""

    recordings: tuple[ReplayedRecording, ...]

    @property
    def identical(self) -> bool:
        """Whether everything was decided as it was recorded."""
        return not any(one.differing_rows or one.differences for one in self.recordings)
