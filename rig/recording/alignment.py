"""What was found between two clocks of one recording, as it stands in the recording's metadata."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pydantic import TypeAdapter, ValidationError

from rig.errors import DataError

ALIGNMENT = "alignment"
# Half of what two crystals differ by anyway: only then did the recording tell it.
KNOWN_PPM = 50.0
By = Literal["events", "correlation"]
Metadata = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True)
class Alignment:
    """How the times of a stream were brought onto the clock of the others.

    A time t of its own clock [s] is ``t + offset_s + 1e-6 * drift_ppm * (t - at_s)`` on the other. The offset lies
    within ``within_s`` at ``at_s`` and within ``anywhere_s`` all through the recording, the drift within
    ``drift_within_ppm``, each in 95 of 100 cases. ``events`` are those of force on a motion, and then what is left
    cannot be told from how the tissue answers; ``correlation`` is that of two motions.
    """

    by: By
    offset_s: float
    within_s: float
    anywhere_s: float
    drift_ppm: float
    drift_within_ppm: float
    at_s: float

    @property
    def sentence(self) -> str:
        """What was found, for a person."""
        known = self.drift_within_ppm < KNOWN_PPM
        drift = f"; it drifts by {self.drift_ppm:.2g} ppm (± {self.drift_within_ppm:.2g})" if known else ""
        tissue = "; a lag of force below that cannot be told from tissue" if self.by == "events" else ""
        return (
            f"was moved by {self.offset_s:+.6g} s onto the other clock, by {self.by}: known within "
            f"{1e3 * self.anywhere_s:.2g} ms{tissue}{drift}"
        )


_ALIGNMENT = TypeAdapter(Alignment)


def alignment_texts(alignments: Mapping[str, Alignment]) -> dict[str, str]:
    """Alignments by stream, as the metadata record that ``read_alignments`` reads."""
    return {stream: _ALIGNMENT.dump_json(alignment).decode() for stream, alignment in alignments.items()}


def read_alignments(metadata: Metadata) -> dict[str, Alignment]:
    """Alignments of a recording by stream, empty where all streams came on one clock; raises DataError."""
    try:
        return {stream: _ALIGNMENT.validate_json(text) for stream, text in metadata.get(ALIGNMENT, {}).items()}
    except ValidationError as error:
        raise DataError(f"the recording's record of its clocks cannot be read: {error.errors()[0]['msg']}") from error
