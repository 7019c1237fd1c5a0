"""What an upload seems to hold: the mapping proposed for it, and what only a person can say."""

from pydantic import Field

from rig.results.base import Result, SavedResult


class ColumnUnderstood(Result):
    """A column, as it would be read."""

    files: str
    quantity: str
    column: str = Field(description="name or number in the file; empty where that is to be answered")
    unit: str = ""
    positive: str = ""


class IntakeQuestion(Result):
    """What the files do not say; ``usual`` is empty where no answer is clearly the best."""

    text: str
    line: str = Field(description="the line of the mapping that answers it")
    usual: str = ""


class ProposalResult(SavedResult):
    """A mapping as TOML, how each column was understood, what is doubtful and what is open."""

    mapping: str
    columns: tuple[ColumnUnderstood, ...]
    doubts: tuple[str, ...]
    questions: tuple[IntakeQuestion, ...]
