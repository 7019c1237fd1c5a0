"""The driver reads the simulated belt, both by the maker's library, on this computer alone."""

import os
import time

from drivers.lsl.device import open_stream
from mock_devices.lsl.mock import BreathingMock
from mock_devices.testing.played import played
from rig.config.products.lsl_stream import LslStream

PATIENCE_S = 10.0


def exchange() -> None:
    """A surface at 20 mm."""
    name = f"extra-{os.getpid()}"
    with played(BreathingMock(name, lambda: 20.0, time.monotonic_ns())):
        inlet = open_stream(LslStream.model_validate({"port": name}))
        inlet.start()
        end_s = time.monotonic() + PATIENCE_S
        while not (samples := inlet.poll(time.monotonic_ns())):
            assert time.monotonic() < end_s, "no sample came"
            time.sleep(0.01)
        inlet.close()
    assert samples[0].values[0] == 20.0
