"""Questions to the person at the bench; where nobody can answer, one sentence with the option that does."""

import sys
import time
from collections.abc import Callable

import typer

from rig.errors import UsageError


class Person:
    """Who stands at the bench. ``pause_s``: instead of waiting for Enter, wait that long after each request."""

    def __init__(self, pause_s: float | None = None, sleep: Callable[[float], None] = time.sleep) -> None:
        self._pause_s, self._sleep = pause_s, sleep

    def answer(self, question: str, option: str) -> str:
        """What is typed; raises UsageError naming ``option`` where there is no terminal."""
        if not sys.stdin.isatty():
            raise UsageError(f"{question}: no terminal to answer at; give {option}")
        return str(typer.prompt(question))

    def refuse_unless_clear(self, way: str) -> None:
        """Raises UsageError, before anything moves, where nobody says that ``way`` is free."""
        if self.answer(f"is the tip's way free from {way}, and the limb out (yes or no)", "--clear") != "yes":
            raise UsageError("the tip's way is not free: nothing was moved")

    def do(self, request: str) -> None:
        """Asks for something to be done and returns when it is; raises UsageError where nobody can say so."""
        if self._pause_s is not None:
            typer.echo(f"{request} ({self._pause_s:g} s)")
            self._sleep(self._pause_s)
        elif sys.stdin.isatty():
            typer.prompt(f"{request}, then press Enter", default="", show_default=False, prompt_suffix="")
        else:
            raise UsageError(f"{request}: no terminal to say that it is done; give --pause SECONDS")
