"""What is asked of the kernel, on files that stand for its devices."""

import os
from pathlib import Path

from rig.realtime import keep_cores_awake


def test_cores_are_kept_awake_as_long_as_the_device_is_held_open(tmp_path: Path) -> None:
    device = tmp_path / "cpu_dma_latency"
    device.touch()
    assert keep_cores_awake(device)
    # Documentation/power/pm_qos_interface.rst of the kernel: 32 bits of microseconds, until the file is closed.
    assert device.read_bytes() == bytes(4)
    (held,) = (fd for fd in Path("/proc/self/fd").iterdir() if fd.resolve() == device)
    os.close(int(held.name))


def test_cores_sleep_where_the_kernel_does_not_grant_it(tmp_path: Path) -> None:
    assert not keep_cores_awake(tmp_path / "absent")
