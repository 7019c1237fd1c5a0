"""`[subject]` of `rig.toml`: who lies under the tip, and what is never passed."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from rig.config.products.roles import Positive
from rig.config.table import Table

# At most what subject.pain_threshold_N may be, for the reason that stands there (rig.config.maxima).
HIGHEST_SITE_N = 50.0


class Subject(Table):
    """Who lies under the tip."""

    id: str = Field(default="phantom", description="a code, no person's name; kept with each recording")
    site: str = Field(default="forearm", description="where the tip presses, kept with each recording")
    pain_threshold_N: Positive = Field(default=15.0, description="the lower of it and limits.force_N holds")
    site_thresholds_N: Mapping[str, Annotated[float, Field(gt=0, le=HIGHEST_SITE_N)]] = Field(
        default={}, description="found at single sites, by their names; at its site each holds beside the others"
    )

    @property
    def threshold_N(self) -> float:
        """At this site: never more than the subject's own."""
        return min(self.pain_threshold_N, self.site_thresholds_N.get(self.site, self.pain_threshold_N))
