"""What one cycle of the servo axis costs: `python -m benchmarks.axis_tick` prints poll + command, and the mock's side.

The driver talks to the mock drive in another process over a pseudo-terminal at 1 kHz; the mock is then timed alone, in
this process, on the bytes of such a cycle. Times are of this machine in this run.
"""

import math
import time

from drivers.epos4.device import Epos4Axis
from mock_devices.testing.epos4 import DriveBench, remote_drive
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits

TICKS = 5000
PERIOD_S = 0.001


def percentiles(times_ns: list[int]) -> str:
    """Median, 99th percentile and worst in microseconds."""
    ordered = sorted(times_ns)
    points = (ordered[len(ordered) // 2], ordered[len(ordered) * 99 // 100], ordered[-1])
    return "p50 {:.1f} us, p99 {:.1f} us, max {:.1f} us".format(*(point / 1000 for point in points))


def driver_tick() -> None:
    """``poll`` and ``command`` of a session that follows a sine."""
    polls: list[int] = []
    commands: list[int] = []
    with remote_drive() as mock:
        axis = Epos4Axis(Epos4Wiring(port=mock.address), Limits())
        axis.start()
        axis.home()
        axis.move_to(10, 30)
        axis.enable()
        due_s = time.monotonic()
        for cycle in range(TICKS):
            due_s += PERIOD_S
            time.sleep(max(due_s - time.monotonic(), 0))
            begun = time.perf_counter_ns()
            axis.poll(time.monotonic_ns())
            polled = time.perf_counter_ns()
            axis.command(10 + math.sin(cycle / 100), time.monotonic_ns())
            commands.append(time.perf_counter_ns() - polled)
            polls.append(polled - begun)
        lost, fault = axis.counters.device_lost, axis.fault or "none"
        axis.close()
    both = [poll + command for poll, command in zip(polls, commands, strict=True)]
    print(f"driver, poll:           {percentiles(polls)}")
    print(f"driver, command:        {percentiles(commands)}")
    print(f"driver, poll + command: {percentiles(both)}; {TICKS} cycles, {lost} answers lost, fault: {fault}")


def mock_tick() -> None:
    """RPDO and SYNC in, two TPDOs and two acknowledgements out, without the pseudo-terminal."""
    bench = DriveBench()
    axis = Epos4Axis(Epos4Wiring(port="memory"), Limits(), bench.now, open_link=bench.open)
    axis.start()
    axis.home()
    axis.enable()
    times = []
    for cycle in range(TICKS):
        bench.heard()
        bench.wire.said = b"t20160F00%02X000000\rt0800\r" % (cycle % 200)
        begun = time.perf_counter_ns()
        bench.mock.receive(bench.now())
        times.append(time.perf_counter_ns() - begun)
    print(f"mock, one SYNC:         {percentiles(times)}")
    axis.close()


if __name__ == "__main__":
    driver_tick()
    mock_tick()
