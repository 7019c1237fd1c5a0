"""What passes between the service and the process that computes a job: lines of JSON, one message each."""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, JsonValue

from api.http.jobs.places import Places

# A computation looks a few times a second whether it is to end; one that does not is ended.
CANCEL_S = 5.0


class Order(BaseModel):
    """What is to be done: ``work`` names a function of an Operation, the kind's parameters and a ``Desk``."""

    kind: str
    work: str
    params: dict[str, JsonValue]
    sessions: Path
    protocols: Path
    uploads: Path
    files: Path
    wiring: str
    """As JSON."""
    hands: str = ""
    """Where the mock bench takes orders; empty on a real bench."""
    stop_word: str = ""
    """Where stops are asked for; empty where nothing moves."""

    @property
    def places(self) -> Places:
        """Where it reads and writes."""
        return Places(self.sessions, self.protocols, self.uploads, self.files)


class Told(BaseModel):
    """From the process: ``step`` (how far), ``say`` (a sentence), ``ask`` (a person is to do it), and one of the ends.

    ``text`` of a result is its JSON; of an error its sentence, whose ``name`` is that of its class.
    """

    type: Literal["step", "say", "ask", "result", "error"]
    text: str = ""
    done: float = 0.0
    name: str = ""
    code: str = ""


class Word(BaseModel):
    """To the process: end soon, or what was asked has been done. No more words: the service is gone."""

    type: Literal["cancel", "done"]
