"""Locks the loop's grid to the force sensor: a cycle begins a little before the sample it acts on can be there.

A timer that runs free of the sensor lets a sample wait for half a cycle on average. The sensor's phase is known from
the capture times of its samples, which `rig.timing` keeps free of what delays single ones, and from the smallest delay
between capture and arrival. The grid is drawn towards that phase by a share of what it is off, and never by more than
the law's time step may be wrong. Arrival itself is no phase: it is when the loop looked, and a grid that follows its
own looks goes anywhere. So cycles begin before the earliest arrival and look at the line until the sample is there, and
earlier still where it is there too soon.
"""

# A step of the law may be this much longer or shorter than it takes it for; a sensor further from the loop's rate, or
# from a whole fraction of it, is not locked to. Two crystals differ by 300 ppm, a filter's rate from its round number
# by 0.4 % (1003.9 Hz for 1000).
MOST_PULL = 0.01
# A tenth of what is off is mended each cycle: a drift of 300 ppm leaves 3 us, jitter of one sample is divided by ten.
GAIN = 0.1
# So long before the earliest arrival a cycle begins: longer than a look at the line takes, so that what is seen is when
# the sample came, and not when the loop woke.
EARLY_NS = 40_000
# A kernel's worker that fills the line may have to wait for the first rest between two looks: a sample that is there
# after it may have come long before. Cycles begin earlier until it takes a look more, faster than clocks drift apart,
# and no more than this; else grid and clock map would follow each other away from the sensor.
SOONEST = 3
HASTE_NS, MOST_HASTE_NS = 2_000, 100_000
# Share of a cycle for which a late sample is waited for: the rest is for work (0.15 ms) and for a core that must sleep.
PATIENCE = 0.2
# How fast the smallest delay may rise where the line became slower: as much as the clock map lets its offset.
SETTLING_PPM = 50
# After so many periods without a sample the sensor is lost, and the grid goes on free.
SILENT_PERIODS = 10


class PhaseLock:
    """``period_ns`` is the cycle that the grid is to have; ``locks`` says whether the sensor's rate allows it."""

    def __init__(self, cycle_ns: int, sensor_ns: int) -> None:
        own_ns = round(sensor_ns / max(1, round(sensor_ns / cycle_ns)))
        self.locks = abs(own_ns - cycle_ns) <= MOST_PULL * cycle_ns
        self.period_ns = own_ns if self.locks else cycle_ns
        self._sensor_ns = sensor_ns
        self._capture_ns: int | None = None
        self._least_ns = 0
        self._early_ns, self._fresh = EARLY_NS, False

    def observe(self, capture_ns: int, arrival_ns: int) -> None:
        """One sample of the sensor, on the computer's clock."""
        self._fresh = True
        delay_ns = arrival_ns - capture_ns
        if self._capture_ns is None:
            self._least_ns = delay_ns
        risen_ns = self._least_ns + (capture_ns - (self._capture_ns or capture_ns)) * SETTLING_PPM // 1_000_000
        self._capture_ns, self._least_ns = capture_ns, min(delay_ns, risen_ns)

    def looked(self, looks: int) -> None:
        """So many looks a cycle took; only one that brought a sample says anything."""
        if self._fresh:
            self._early_ns += HASTE_NS if looks < SOONEST else -HASTE_NS
            self._early_ns = min(max(self._early_ns, EARLY_NS), EARLY_NS + MOST_HASTE_NS)
        self._fresh = False

    def correction_ns(self, due_ns: int) -> int:
        """By how much the cycle due then and all after it are to be moved; 0 where there is no sensor to follow."""
        most_ns = MOST_PULL * self.period_ns
        return round(min(max(-GAIN * self._off_ns(due_ns, self.period_ns), -most_ns), most_ns))

    def patience_ns(self, due_ns: int) -> int:
        """Until when a cycle due then is to look for its sample; ``due_ns`` where it is here, or none is on its way."""
        off_ns, span_ns = self._off_ns(due_ns, self._sensor_ns), PATIENCE * self.period_ns
        expected = self._follows(due_ns) and abs(off_ns) < span_ns and self._in_time(due_ns)
        return max(due_ns, due_ns - off_ns + self._early_ns + round(span_ns)) if expected else due_ns

    def _off_ns(self, due_ns: int, period_ns: int) -> int:
        """How much later ``due_ns`` is than a cycle is to begin before the nearest arrival; negative where earlier."""
        if self._capture_ns is None or not self._follows(due_ns):
            return 0
        off_ns = due_ns + self._early_ns - self._capture_ns - self._least_ns
        return (off_ns + period_ns // 2) % period_ns - period_ns // 2

    def _since_ns(self, due_ns: int) -> int:
        """From the earliest arrival of the newest sample to ``due_ns``."""
        return due_ns - (self._capture_ns or 0) - self._least_ns

    def _follows(self, due_ns: int) -> bool:
        known = self.locks and self._capture_ns is not None
        return known and self._since_ns(due_ns) < SILENT_PERIODS * self._sensor_ns

    def _in_time(self, due_ns: int) -> bool:
        """Whether the sample before is here and this one not; an adapter may deliver several at once, and late."""
        return 0.5 < self._since_ns(due_ns) / self._sensor_ns < 1.5
