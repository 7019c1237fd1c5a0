"""From the moment at which the sensor took a sample to the moment at which the drive had the set-point made from it."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Table = NDArray[np.void]


def delays_us(sent_ns: NDArray[np.int64], found_ns: Sequence[int]) -> list[float]:
    """Each SYNC with the first arrival after it that no earlier one has; both rise."""
    return [(found - sent) / 1000 for sent, found in matched(sent_ns, found_ns).items()]


def matched(sent_ns: NDArray[np.int64], found_ns: Sequence[int]) -> dict[int, int]:
    """SYNC to arrival; without those that no arrival is left for."""
    arrivals, at = dict[int, int](), 0
    for sent in sent_ns.tolist():
        while at < len(found_ns) and found_ns[at] < sent:
            at += 1
        if at == len(found_ns):
            break
        arrivals[sent] = found_ns[at]
        at += 1
    return arrivals


def chain_us(tables: Mapping[str, Table], taken: Sequence[tuple[int, int]], found_ns: Sequence[int]) -> list[float]:
    """Delays of all samples that a cycle used first, by the bench's own clock.

    ``taken``: mark and time of each sample, as the sensor says; ``found_ns``: when the drive took its SYNCs. A cycle
    used the sample whose capture lies ``force_age_ns`` before its row; its SYNC is the first after that.
    """
    force, loop, axis = tables["force"], tables["loop"], tables["axis"]
    taken_ns = dict(taken)
    arrivals = matched(axis["capture_ns"], found_ns)
    used, first = np.unique(loop["capture_ns"] - loop["force_age_ns"], return_index=True)
    marks = dict(zip(force["capture_ns"].tolist(), force["device_us"].tolist(), strict=True))
    at = np.searchsorted(axis["capture_ns"], loop["capture_ns"][first])
    pairs = zip(used.tolist(), at.tolist(), strict=True)
    sent_of = {capture: int(axis["capture_ns"][index]) for capture, index in pairs if index < axis.size}
    times = ((taken_ns.get(marks.get(capture, -1)), arrivals.get(sent)) for capture, sent in sent_of.items())
    return [(found - sampled) / 1000 for sampled, found in times if sampled is not None and found is not None]
