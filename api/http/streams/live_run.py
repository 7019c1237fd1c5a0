"""Rows of the ring, sorted into the histories of one run of the bench."""

import uuid

import numpy as np
from numpy.typing import NDArray

from api.http.streams.history import LiveHistory, Rows
from api.http.streams.signals import marker_source, rates_Hz, sources
from rig.channels import AXIS, FORCE, LOOP, MARKER
from rig.config.wiring import Wiring
from rig.recording.slots import Slots, holding, rows_of


class LiveRun:
    """The samples of one loop, from its start to its end; the next loop counts anew and is another run."""

    def __init__(self, wiring: Wiring) -> None:
        self.id = uuid.uuid4().hex[:12]
        self.ended = False
        rates = rates_Hz(wiring)
        self.histories = {
            name: LiveHistory(fields, rates[name.partition(".")[0]]) for name, fields in sources(wiring).items()
        }
        self._force_map = wiring.force_map
        self._tools = wiring.tracker.tools if wiring.tracker else ()
        self._zero_N = np.nan

    def add(self, slots: Slots) -> None:
        """Sorts in whole cycles: rows of the devices, and last the loop's own, which nobody finds before those."""
        force, loop = rows_of(slots, FORCE), rows_of(slots, LOOP)
        compression_N = self._force_map.compression_N(force["fx_N"], force["fy_N"], force["fz_N"])
        zeros_N = self._zeros_N(slots, np.asarray(compression_N), loop["force_N"])
        self._keep("force", force, compression_N=compression_N, force_N=compression_N - zeros_N)
        self._keep("axis", rows_of(slots, AXIS))
        markers = rows_of(slots, MARKER)
        for number, tool in enumerate(self._tools):
            self._keep(marker_source(tool), markers[markers["tool"] == number])
        self._keep("loop", loop, error_N=loop["reference_N"] - loop["force_N"])

    def _zeros_N(
        self, slots: Slots, compression_N: NDArray[np.float64], shown_N: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The zero that each reading of the sensor was taken from in its cycle; both in newtons of compression."""
        force_at, loop_at = (np.flatnonzero(holding(slots, stream)) for stream in (FORCE, LOOP))
        newest = np.searchsorted(force_at, loop_at) - 1
        zeros_N = np.full(len(loop_at) + 1, self._zero_N)
        known = newest >= 0
        zeros_N[:-1][known] = compression_N[newest[known]] - shown_N[known]
        # Readings behind the last cycle, of a loop that was ended in the midst of one.
        zeros_N[-1] = self._zero_N = zeros_N[-2] if len(loop_at) else self._zero_N
        return zeros_N[np.searchsorted(loop_at, force_at)]

    def _keep(self, source: str, rows: Rows, **made: NDArray[np.float64]) -> None:
        history = self.histories[source]
        kept = np.empty(len(rows), history.dtype)
        kept["seq"], kept["time_ns"] = rows["seq"], rows["capture_ns"]
        for name in (history.dtype.names or ())[2:]:
            kept[name] = made[name] if name in made else rows[name]
        history.add(kept)
