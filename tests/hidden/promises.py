"""What a few sessions of a run's own can show of rates that are promised."""

import os
from collections.abc import Sequence

from benchmarks.campaigns.campaign import Campaign
from benchmarks.campaigns.case import Record
from benchmarks.campaigns.counts import share_of

SEED = int(os.environ["TISSUE_RIG_SEED"])
"""Drawn anew and printed by each run, see `tests/conftest.py`."""
LEVEL = 0.999


def contradicted(campaign: Campaign, records: Sequence[Record]) -> list[str]:
    """Goals that hold so rarely with such counts that they do not hold."""
    shares = [share_of(question, list(records)) for question in campaign.questions]
    return [share.line for share in shares if share.contradicts(LEVEL)]


def of_kind(kind: str, rotation: Sequence[str]) -> int:
    """The first seed of that kind from the run's own on."""
    return next(seed for seed in range(SEED, SEED + len(rotation)) if rotation[seed % len(rotation)] == kind)
