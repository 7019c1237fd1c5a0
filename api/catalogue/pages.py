"""Pages of a list, and the cursor at which the next one begins: the same for what lies in tables and in memory."""

import base64
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from api.catalogue.settings import MOST, USUAL
from rig.errors import UsageError
from rig.results.catalogue import storable

Item = TypeVar("Item")
# What the order of a list goes by; no two entries have the same.
Place = tuple[str, str]


@dataclass(frozen=True)
class Page:
    """How many entries, and after which: the ``next`` of the page before. Raises UsageError for any other size."""

    limit: int = USUAL
    cursor: str = ""

    def __post_init__(self) -> None:
        if not 1 <= self.limit <= MOST:
            raise UsageError(f"limit {self.limit}: a page has 1 to {MOST} entries; ask for the rest by its cursor")

    def after(self, of: str) -> Place | None:
        """Where the page before ended, None on the first; raises UsageError for what the list ``of`` never gave."""
        if not self.cursor:
            return None
        try:
            whose, *place = json.loads(base64.urlsafe_b64decode(self.cursor + "=" * (-len(self.cursor) % 4)))
            first, second = map(storable, place)
            if whose == of and isinstance(first, str) and isinstance(second, str):
                return first, second
        except (ValueError, TypeError, RecursionError):
            pass
        shown = storable(self.cursor[:40])
        raise UsageError(f"cursor {shown}: is none that was given by this list; leave it out to begin anew")

    def first(
        self, of: str, found: Sequence[Item], place: Callable[[Item], Place]
    ) -> tuple[tuple[Item, ...], str | None]:
        """This page of ``found``, which are in order and all behind the page before, and the cursor of the next."""
        shown = tuple(found[: self.limit])
        return shown, _cursor(of, place(shown[-1])) if len(found) > self.limit else None


FIRST = Page()


def cut(
    page: Page | None, of: str, found: Iterable[Item], place: Callable[[Item], Place], newest_first: bool = False
) -> tuple[tuple[Item, ...], str | None]:
    """That page of all there are, in whatever order they come, and the cursor of the next; without ``page`` all."""
    ordered = sorted(found, key=place, reverse=newest_first)
    if page is None:
        return tuple(ordered), None
    last = page.after(of)
    rest = [one for one in ordered if last is None or (place(one) < last if newest_first else place(one) > last)]
    return page.first(of, rest, place)


def _cursor(of: str, place: Place) -> str:
    return base64.urlsafe_b64encode(json.dumps([of, *place]).encode()).decode().rstrip("=")
