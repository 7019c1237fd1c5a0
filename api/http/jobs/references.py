"""A force over time, from what a request says of it."""

from itertools import pairwise

from api.http.jobs.params import ForceOverTime
from controller.experiments.references import Reference, parse_reference
from rig.errors import UsageError

FEWEST_POINTS = 2  # a line has two ends


def reference_of(asked: ForceOverTime) -> Reference:
    """The reference; raises UsageError naming key, bound or point."""
    if not asked.points:
        if asked.reference.startswith("csv:"):
            raise UsageError("reference csv: names a file of another computer; send its rows as points")
        return parse_reference(asked.reference)
    if len(asked.points) < FEWEST_POINTS:
        raise UsageError(f"points: a reference has {FEWEST_POINTS} or more, not {len(asked.points)}")
    for number, (before, after) in enumerate(pairwise(asked.points), FEWEST_POINTS):
        if after[0] <= before[0]:
            text = f"points: time {after[0]:g} s of point {number} does not come after {before[0]:g} s; it must grow"
            raise UsageError(text)
    start_s = asked.points[0][0]
    times, forces = zip(*asked.points, strict=True)
    return Reference("points", tuple(time - start_s for time in times), tuple(forces))
