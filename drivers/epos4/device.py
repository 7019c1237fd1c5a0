"""The servo axis on a CiA 402 drive, a maxon EPOS4 unless said: set-up, homing, moves, cyclic positions, stops, faults.

Set-up and moves wait and use SDO; each wait has a deadline from distance and speed, or the SDO time-out. In the cycle
``command`` is one write (RPDO1 and SYNC) and ``poll`` one read. The drive stops by itself when the host falls silent:
its watch starts with the first ``poll`` or move after ``start``, and from then on ``poll`` must be called more often
than `setup.host_heartbeat_limit_ms`.
"""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence

from drivers.can.bus import CanLink
from drivers.can.opening import OpenLink, opener
from drivers.can.shared import view_of
from drivers.can.slcan import CanFrame
from drivers.canopen.nmt import RPDO_IDS, SYNC, TPDO_IDS, NmtCommand
from drivers.epos4 import objects, setup
from drivers.epos4.bringup import CYCLIC_POSITION, HOMING, PROFILE_POSITION, configure, go_operational
from drivers.epos4.cia402 import Controlword, Goal, PdsState, Statusword
from drivers.epos4.codec import encode_setpoint
from drivers.epos4.faults import describe
from drivers.epos4.kind import DriveKind, Epos4Kind
from drivers.epos4.node import Node
from drivers.epos4.samples import SampleBuilder
from drivers.epos4.walker import REACTION_S, Walker, never
from drivers.roles import Identity, LinkCounters
from drivers.sampled import SampledDevice, allowed_mm
from rig.channels import AxisSample
from rig.config.products.can_axis import CanAxisProduct
from rig.config.wiring import Limits
from rig.errors import DeviceError, RigError, SafetyStop

HOMING_START_S = 0.05
"""Within this a drive takes back an older "homing attained"; one that has homed already shows it again."""
CLOSING_TIMEOUT_S = 0.3  # a drive that is gone costs it several times over, and a person waits


class Epos4Axis(SampledDevice):
    """ServoAxis on one drive; nothing is opened before ``start``. ``rate_Hz`` is how often ``command`` will come.

    ``interrupted`` is asked while the axis homes, moves or is enabled; a yes brakes it and raises SafetyStop.
    """

    _samples: SampleBuilder

    def __init__(
        self,
        config: CanAxisProduct,
        limits: Limits,
        now: Callable[[], int] = time.monotonic_ns,
        rate_Hz: float = 1000.0,
        open_link: OpenLink | None = None,
        interrupted: Callable[[], bool] = never,
        kind: DriveKind | None = None,
    ) -> None:
        self.counters = LinkCounters()
        self._period_ns = round(1e9 / rate_Hz)
        self._config = config
        self._limits = limits
        self._now = now
        self._open_link = open_link or (view_of if config.shared else opener)(config)
        self._interrupted = interrupted
        self._kind = kind or Epos4Kind(config)
        self._homed = False
        self._name = f"servo axis on {config.port}, node {config.node}"
        self._samples = SampleBuilder(self._kind)
        self._identity = Identity("", "", "")
        self._link: CanLink | None = None
        self._walker: Walker | None = None
        self._target = 0
        self._refused_before = 0

    @property
    def period_ns(self) -> int:
        """Nominal time between samples: that between set-points."""
        return self._period_ns

    @property
    def fault(self) -> str:
        """Error code and meaning, empty if the drive reports none."""
        return self._walker.fault if self._walker else ""

    @property
    def enabled(self) -> bool:
        """Whether the drive follows cyclic positions now."""
        walker = self._walker
        return (
            walker is not None
            and walker.mode == CYCLIC_POSITION
            and walker.controlword == Controlword.ENABLE_OPERATION
            and walker.state is PdsState.ENABLED
        )

    @property
    def referenced(self) -> bool:
        """Whether positions count from home, as the drive last said."""
        return self._walker is not None and self._is_referenced(self._walker.status)

    @property
    def bus(self) -> str:
        """Load and errors of the CAN bus, in words; raises DeviceError before ``start``."""
        return self._started().node.link.health.summary

    def fileno(self) -> int:
        """Descriptor of the CAN link; raises DeviceError before ``start``."""
        return self._started().node.link.fileno()

    def start(self) -> None:
        """Opens the adapter, identifies the drive, writes limits and stops and reads them back, maps the PDOs."""
        self.close()
        self._homed = False
        config = self._config
        self._link = self._opened()
        node = self._node(self._link)
        self._samples = SampleBuilder(self._kind, self._samples.next_seq)
        node.handlers[TPDO_IDS[0] + config.node] = self._samples.take_state
        node.handlers[TPDO_IDS[1] + config.node] = self._samples.take_motion
        walker = Walker(node, self._now, self._limits.speed_mm_s / config.acceleration_mm_s2)
        try:
            node.order(NmtCommand.ENTER_PRE_OPERATIONAL)
            self._identity = self._kind.identify(node)
            if unsaid := self._kind.agree(node):
                self._identity.settings["scale"] = unsaid
            self._walker = walker
            walker.standstill = self._kind.standstill
            walker.make_safe()
            configure(node, self._kind.writes(self._limits))
            go_operational(node, config, self._now)
            walker.note_old_fault()
        except BaseException:
            self.close()
            raise
        node.restarted = False
        self._refused_before = self._link.decoder.refused

    def identify(self) -> Identity:
        """Who is there; no object is written, and the node stays in its state."""
        with contextlib.closing(self._opened()) as link:
            return self._kind.identify(self._node(link))

    def _opened(self) -> CanLink:
        return self._open_link(self._config.port, self._config.bitrate, self._now)

    def _node(self, link: CanLink) -> Node:
        config = self._config
        return Node(link, config.node, setup.host_node(config), config.heartbeat_ms, self._name, self._now)

    def home(self) -> None:
        """Finds the reference by the configured method; raises DeviceError where it does not within the travel."""
        walker = self._started()
        done = Statusword.ACKNOWLEDGE | Statusword.TARGET_REACHED
        ended = Statusword.MODE_ERROR | Statusword.FAULT
        with self._moving(walker):
            walker.set_mode(HOMING)
            walker.walk(Goal.ENABLED)
            walker.control(Controlword.ENABLE_OPERATION)
            walker.control(Controlword.ENABLE_OPERATION | Controlword.START)
            walker.watch(HOMING_START_S, lambda status: not status & done)
            limit_s = self._homing_time_s()
            walker.watch(limit_s, lambda status: status & done == done or bool(status & ended))
            self._homed = walker.status & done == done and not walker.status & ended
            found = self._is_referenced(walker.status) and self._homed
            if walker.status & ended or not found:
                raise DeviceError(
                    f"{self._name}: homing by method {self._config.homing_method} found no reference within "
                    f"{limit_s:.1f} s ({self.fault or 'no fault'}); check the reference switch"
                )
            walker.control(Controlword.ENABLE_OPERATION)

    def move_to(self, position_mm: float, speed_mm_s: float) -> None:
        """Moves by the drive's own profile, waits for the end; raises SafetyStop beyond a limit, else DeviceError."""
        walker = self._started()
        self._check_referenced(walker, "moving")
        target = self._checked(position_mm)
        self._check_speed(speed_mm_s)
        node = walker.node
        with self._moving(walker):
            distance_mm = abs(position_mm - self._kind.scale.mm(node.read(objects.POSITION)))
            travel_s = distance_mm / speed_mm_s + 2 * speed_mm_s / self._config.acceleration_mm_s2
            walker.set_mode(PROFILE_POSITION)
            walker.walk(Goal.ENABLED)
            node.write(objects.PROFILE_VELOCITY, self._kind.scale.rpm(speed_mm_s))
            node.write(objects.TARGET, target)
            walker.control(Controlword.ENABLE_OPERATION)
            walker.control(Controlword.ENABLE_OPERATION | Controlword.START | Controlword.IMMEDIATELY)
            walker.require(REACTION_S, Statusword.ACKNOWLEDGE, True, "the set-point was not acknowledged")
            walker.control(Controlword.ENABLE_OPERATION)
            walker.require(REACTION_S, Statusword.ACKNOWLEDGE, False, "the set-point's acknowledgement stays")
            missed = f"{position_mm:g} mm at {speed_mm_s:g} mm/s was not reached"
            walker.require(travel_s + REACTION_S, Statusword.TARGET_REACHED, True, missed)
        self._target = target

    def enable(self) -> None:
        """Torque on, in cyclic synchronous position at the present position."""
        walker = self._started()
        self._check_referenced(walker, "enabling")
        with self._moving(walker):
            self._target = self._checked(self._kind.scale.mm(walker.node.read(objects.POSITION)))
            walker.node.write(objects.TARGET, self._target)
            walker.set_mode(CYCLIC_POSITION)
            walker.walk(Goal.ENABLED)
            walker.control(Controlword.ENABLE_OPERATION)

    def poll(self, now_ns: int) -> Sequence[AxisSample]:
        """Samples since the last call; raises DeviceError where the drive's heartbeat is missing or it restarted."""
        walker = self._started()
        node = walker.node
        node.receive(now_ns)
        node.beat(now_ns)
        self._check_alive(node, now_ns)
        samples = self._samples.collect()
        if samples:
            walker.status = samples[-1].status
        counters, decoder = self.counters, node.link.decoder
        counters.frames = decoder.frames
        counters.discarded_bytes = decoder.discarded_bytes
        counters.trouble = node.link.health.trouble
        counters.device_lost = self._samples.matcher.lost + decoder.refused - self._refused_before
        return samples

    def command(self, position_mm: float, now_ns: int) -> None:
        """Set-point and SYNC in one write; raises SafetyStop beyond the limits, and then sends nothing."""
        walker = self._started()
        self._target = self._checked(position_mm)
        self._sync(walker, now_ns)

    def request(self, now_ns: int) -> None:
        """SYNC alone: a sample, and nothing commanded."""
        self._started().node.link.send(SYNC)
        self._samples.matcher.sent(now_ns)

    def quick_stop(self) -> None:
        """Brakes by the drive's ramp and stays stopped, with torque, until ``enable``; does not wait."""
        walker = self._started()
        walker.controlword = int(Controlword.QUICK_STOP)
        self._sync(walker, self._now())

    def power_off(self) -> None:
        """Without torque from the next PDO on, until ``enable``; does not wait."""
        walker = self._started()
        walker.controlword = int(Controlword.DISABLE_VOLTAGE)
        self._sync(walker, self._now())

    def history(self) -> tuple[str, ...]:
        """The errors the drive remembers (object 1003), in words, newest first."""
        node = self._started().node
        count = node.read(objects.ERROR_COUNT)
        return tuple(describe(node.read(entry) & 0xFFFF) for entry in objects.ERROR_HISTORY[:count])

    def reset_fault(self) -> None:
        """Acknowledges a fault; raises DeviceError where it is still there. The drive has no torque afterwards."""
        walker = self._started()
        walker.reset_fault()
        if not walker.status & Statusword.REMOTE:
            go_operational(walker.node, self._config, self._now)

    def close(self) -> None:
        """Stops, takes the torque away, and gives the port back; never raises."""
        if self._walker:
            node = self._walker.node
            node.timeout_s = CLOSING_TIMEOUT_S
            with contextlib.suppress(RigError):
                self._walker.make_safe()
                node.write(objects.HEARTBEAT_CONSUMER, 0)
                node.order(NmtCommand.ENTER_PRE_OPERATIONAL)
        if self._link:
            self._link.close()
        self._walker = self._link = None

    def _is_referenced(self, status: int) -> bool:
        """By the bit in which this kind of drive says it; where it has none, since it was homed in this session."""
        bit = self._kind.referenced_bit
        return bool(status & bit) if bit else self._homed

    def _started(self) -> Walker:
        if self._walker is None:
            raise DeviceError(f"{self._name}: is not started or was closed; start it first")
        return self._walker

    def _sync(self, walker: Walker, now_ns: int) -> None:
        setpoint = CanFrame(RPDO_IDS[0] + self._config.node, encode_setpoint(walker.controlword, self._target))
        walker.node.link.send(setpoint, SYNC)
        self._samples.matcher.sent(now_ns)

    def _check_alive(self, node: Node, now_ns: int) -> None:
        if node.restarted:
            raise DeviceError(f"{self._name}: restarted by itself and lost its limits; check its supply, start again")
        silent_ns = now_ns - node.heard_ns
        if silent_ns > setup.drive_heartbeat_limit_ns(self._config):
            raise DeviceError(
                f"{self._name}: its heartbeat is missing for {silent_ns / 1e6:.0f} ms, expected every "
                f"{self._config.heartbeat_ms} ms; check its power and the CAN cable"
            )

    def _check_referenced(self, walker: Walker, what: str) -> None:
        if not self._is_referenced(walker.read_status()):
            raise DeviceError(f"{self._name}: has no reference, and {what} needs one; home the axis first")

    def _check_speed(self, speed_mm_s: float) -> None:
        if not 0 < speed_mm_s <= self._limits.speed_mm_s:
            raise SafetyStop(
                f"{self._name}: refused to move at {speed_mm_s:g} mm/s; limits.speed_mm_s is "
                f"{self._limits.speed_mm_s:g} mm/s"
            )

    def _checked(self, position_mm: float) -> int:
        """The position in increments, if the limits allow it."""
        return self._kind.scale.increments(allowed_mm(position_mm, self._limits, self._name))

    @contextlib.contextmanager
    def _moving(self, walker: Walker) -> Iterator[None]:
        """From before the first motion the drive watches the host; whatever goes wrong here stops the axis."""
        walker.node.beat(self._now())
        walker.interrupted = self._interrupted
        try:
            yield
        except BaseException:
            with contextlib.suppress(RigError):
                self.quick_stop()
            raise
        finally:
            walker.interrupted = never

    def _homing_time_s(self) -> float:
        """Twice the travel at homing speed, one turn of the screw at the slow speed, and the ramps between."""
        travel_mm = self._limits.position_max_mm - self._limits.position_min_mm
        speed_mm_s = self._config.homing_speed_mm_s
        slow_s = self._kind.turn_mm / (speed_mm_s * setup.SLOW_SEARCH)
        ramps_s = 4 * speed_mm_s / self._config.acceleration_mm_s2
        return 2 * travel_mm / speed_mm_s + slow_s + ramps_s + REACTION_S
