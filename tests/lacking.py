"""What a test needs of the computer and does not find there."""

import os
from typing import NoReturn

import pytest

# Set by `.ci/run`: there a test that cannot run is a failure, as nobody reads what was skipped.
ALL = "TISSUE_RIG_ALL"


def lacking(what: str) -> NoReturn:
    """Skips the test with that sentence, or fails it where all of them have to run."""
    if os.environ.get(ALL):
        pytest.fail(f"{what}; with {ALL} set no test may skip", pytrace=False)
    pytest.skip(what)
