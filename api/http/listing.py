"""Lists that lie in memory: by query and page by page, as those of the catalogue."""

from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from pydantic import BaseModel

from api.catalogue.pages import Page, Place, cut

Item = TypeVar("Item", bound=BaseModel)


class Listing(BaseModel, Generic[Item]):
    """A page of a list; ``next`` is the cursor of what follows, null at the end."""

    items: list[Item]
    next: str | None = None


def listing(
    of: str,
    found: Iterable[Item],
    page: Page,
    place: Callable[[Item], Place],
    newest_first: bool = False,
    **wanted: str | bool | None,
) -> Listing[Item]:
    """That page of those whose fields are as ``wanted``; "" and None ask for nothing. UsageError for a wrong cursor."""
    asked = {name: value for name, value in wanted.items() if value not in ("", None)}
    fitting = (one for one in found if asked.items() <= vars(one).items())
    items, following = cut(page, of, fitting, place, newest_first)
    return Listing(items=list(items), next=following)
