"""What is written into the drive before anything moves, as pure tables of objects and values."""

from drivers.epos4 import objects
from drivers.epos4.codec import Units, pdo_maps
from drivers.epos4.objects import DISABLED, Entry
from rig.config.products.can_axis import CanAxisProduct
from rig.config.wiring import Limits

HOST_NODES = (127, 126)
LIMIT_MARGIN_MM = 0.5
"""How far outside the configured limits the drive's own stand: a hold at a limit ripples, and must not be a fault."""
SLOW_SEARCH = 0.1
"""Speed at which the reference switch is left, as a share of the homing speed: 2 um in each ms at 20 mm/s."""
# The maker's advice for whoever listens to heartbeats.
LEAST_CONSUMER_MARGIN_MS = 20
# Without the host nobody looks at the force: one lost heartbeat is forgiven. A silent drive is seen sooner by its
# missing samples, and its heartbeats only decide that it is gone: two are.
HOST_MISSES = 2
DRIVE_MISSES = 3


def host_node(config: CanAxisProduct) -> int:
    """The number under which the host sends its heartbeat: 127, or 126 where the drive is 127."""
    return HOST_NODES[config.node == HOST_NODES[0]]


def host_heartbeat_limit_ms(config: CanAxisProduct) -> int:
    """Silence of the host after which the drive stops: two periods, but 20 ms more than one, as the maker advises."""
    return max(HOST_MISSES * config.heartbeat_ms, config.heartbeat_ms + LEAST_CONSUMER_MARGIN_MS)


def drive_heartbeat_limit_ns(config: CanAxisProduct) -> int:
    """Silence of the drive after which it counts as lost: three periods, but 20 ms more than one."""
    limit_ms = max(DRIVE_MISSES * config.heartbeat_ms, config.heartbeat_ms + LEAST_CONSUMER_MARGIN_MS)
    return limit_ms * 1_000_000


def drive_limits(limits: Limits, scale: Units) -> tuple[int, int]:
    """Objects 607D:1 and :2 in increments, smaller first."""
    ends = (limits.position_min_mm - LIMIT_MARGIN_MM, limits.position_max_mm + LIMIT_MARGIN_MM)
    low, high = sorted(scale.increments(end_mm) for end_mm in ends)
    return low, high


def parameters(config: CanAxisProduct, limits: Limits, scale: Units) -> list[tuple[Entry, int]]:
    """Limits, stops, speeds and heartbeats; all of it is read back after it was written.

    The interpolation time stays 0: otherwise a single late set-point is a fault (8250), and the host is no real-time
    system. Sub 1 of 1016 is written last, it arms the stop that follows the host's silence.
    """
    low, high = drive_limits(limits, scale)
    acceleration = scale.rpm(config.acceleration_mm_s2)
    homing = scale.rpm(config.homing_speed_mm_s)
    return [
        (objects.LIMIT_LOW, low),
        (objects.LIMIT_HIGH, high),
        (objects.MAX_PROFILE_VELOCITY, scale.rpm(limits.speed_mm_s)),
        (objects.FOLLOWING_WINDOW, scale.length(config.following_error_mm)),
        (objects.QUICK_STOP_DECELERATION, acceleration),
        (objects.PROFILE_ACCELERATION, acceleration),
        (objects.PROFILE_DECELERATION, acceleration),
        (objects.CURRENT_LIMIT, round(config.current_limit_A * 1000)),
        (objects.ABORT_OPTION, 3),
        (objects.QUICK_STOP_OPTION, 6),
        (objects.SHUTDOWN_OPTION, 1),
        (objects.DISABLE_OPTION, 1),
        (objects.FAULT_OPTION, 2),
        (objects.INTERPOLATION, 0),
        (objects.HOMING_METHOD, config.homing_method),
        (objects.HOMING_SPEED_SWITCH, homing),
        (objects.HOMING_SPEED_ZERO, max(1, round(homing * SLOW_SEARCH))),
        (objects.HOMING_ACCELERATION, acceleration),
        (objects.HEARTBEAT_PRODUCER, config.heartbeat_ms),
        (objects.HEARTBEAT_CONSUMER, host_node(config) << 16 | host_heartbeat_limit_ms(config)),
    ]


def process_data(config: CanAxisProduct) -> list[tuple[Entry, int]]:
    """Writes that configure the PDOs, in their order."""
    return [write for pdo in pdo_maps(config.node) for write in pdo.writes()]


def expected(writes: list[tuple[Entry, int]]) -> dict[Entry, int]:
    """What reading back must give: the last value of each object; of an identifier only whether it is on, and which."""
    return dict(writes)


def agrees(entry: Entry, wanted: int, got: int) -> bool:
    """Whether a value read back is the one written; drives may add the flag that forbids remote requests."""
    identifier = entry.sub == 1 and (0x1400 <= entry.index < 0x1600 or 0x1800 <= entry.index < 0x1A00)
    mask = DISABLED | 0x7FF if identifier else -1
    return wanted & mask == got & mask
