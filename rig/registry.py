"""Declarations by name: products, laws, causes. Each is registered once; a wrong name is answered with the nearest.

A distribution adds its own by entry points: `cubic = "acme.cubic:Cubic"` in group `tissue_rig.law`, for example.
"""

import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Generic, TypeVar

from rig.errors import UsageError
from rig.plugins import Admission, admit, hint

Item = TypeVar("Item")


def nearest(name: str, names: Iterable[str]) -> str:
    """The one of ``names``, of which there is one at least, that is most like ``name``."""
    return difflib.get_close_matches(name, list(names), n=1, cutoff=0.0)[0]


def known(name: str, names: Iterable[str], what: str) -> str:
    """``name`` where it is one of ``names``; raises UsageError naming ``what`` it should be and the nearest one."""
    choices = list(names)
    if name in choices:
        return name
    if not choices:
        raise UsageError(f"unknown {what} {name!r}; there is no {what} here")
    raise UsageError(
        f"unknown {what} {name!r}; nearest valid {what}: {nearest(name, choices)}; all: {', '.join(choices)}{hint()}"
    )


class Registry(Mapping[str, Item], Generic[Item]):
    """Declarations in the order in which they were registered; ``what`` is what one of them is called in messages.

    After ``items`` come the entry points of ``group`` that ``refusal`` says nothing against (`rig.plugins`).
    """

    def __init__(
        self, what: str, name_of: Callable[[Item], str], items: Iterable[Item], group: str = "",
        refusal: Callable[[object], str] = lambda _: "",
    ) -> None:  # fmt: skip
        self._what, self._name_of = what, name_of
        self._items: dict[str, Item] = {}
        for item in items:
            self.register(item)
        admit(group, Admission(name_of, refusal, self.register))

    def register(self, item: Item) -> Item:
        """Adds ``item`` and returns it; raises ValueError where its name is taken."""
        name = self._name_of(item)
        if name in self._items:
            raise ValueError(f"there is a {self._what} {name!r} already")
        self._items[name] = item
        return item

    def named(self, name: str) -> Item:
        """The item called so; raises UsageError with the nearest name and all of them."""
        return self._items[known(name, self, self._what)]

    def __getitem__(self, name: str) -> Item:
        """The item called so; raises KeyError."""
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        """Names."""
        return iter(self._items)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._items)
