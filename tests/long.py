"""Which tests take long, and which quarter of them a commit runs.

`long_tests.txt` names those that took more than two seconds each, or six where they start processes, beside others on
a slow computer; what a change breaks in most cases is left out of it, however long it takes. They have the marker
``long``: `make test` leaves them out. ``--draw SEED`` keeps a quarter of all tests that are selected, and four seeds
that follow each other keep each test once: CI draws by the commit, `make campaigns` runs them all. What has the marker
``every_commit`` is kept by each draw.
"""

import zlib
from collections.abc import Collection
from pathlib import Path

import pytest

FILE = Path(__file__).with_name("long_tests.txt")
SHARE = 4


def listed(file: Path = FILE) -> frozenset[str]:
    """Tests that take long, as ``path::name``; each stands for all its parameters."""
    return frozenset(file.read_text(encoding="utf-8").split())


def is_drawn(test: str, seed: int) -> bool:
    """Whether the draw ``seed`` keeps the test of that node."""
    return zlib.crc32(test.encode()) % SHARE == seed % SHARE


class LongTests:
    """The plugin: marks those ``named``, and leaves out what is not drawn."""

    def __init__(self, named: Collection[str]) -> None:
        self._named = named

    @pytest.hookimpl(tryfirst=True)  # before they are selected by marker
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        for item in items:
            if item.nodeid.partition("[")[0] in self._named:
                item.add_marker(pytest.mark.long)
        seed: int | None = config.getoption("draw")
        if seed is None:
            return
        kept: list[pytest.Item] = []
        left_out: list[pytest.Item] = []
        for item in items:
            stays = item.get_closest_marker("every_commit") or is_drawn(item.nodeid, seed)
            (kept if stays else left_out).append(item)
        config.hook.pytest_deselected(items=left_out)
        items[:] = kept
