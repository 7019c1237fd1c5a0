"""Looks at each input by itself: who it is, its rate, and what is wrong with it."""

import time
from contextlib import closing

import numpy as np

from controller.devices.guard import RATE_TOLERANCE
from controller.inputs.runner import open_input
from drivers.input_role import Input
from rig.config.products.input_role import InputProduct
from rig.errors import RigError
from rig.input_streams import InputSample
from rig.results.bench import DeviceReport

PERIOD_S = 0.002


def look_at(name: str, config: InputProduct, seconds: float) -> DeviceReport:
    """The finding on input ``name``; one that fails is a finding with a problem, not an error."""
    try:
        with closing(open_input(config)) as device:
            device.start()
            return _finding(name, config, device, _listen(device, seconds))
    except RigError as error:
        return DeviceReport(role=name, problem=str(error), advice=config.advice)


def _listen(device: Input, seconds: float) -> list[InputSample]:
    found: list[InputSample] = []
    end_ns = time.monotonic_ns() + round(seconds * 1e9)
    while (now_ns := time.monotonic_ns()) < end_ns:
        found.extend(device.poll(now_ns))
        time.sleep(PERIOD_S)
    return found


def _finding(name: str, config: InputProduct, device: Input, samples: list[InputSample]) -> DeviceReport:
    who = device.identity
    about = DeviceReport(role=name, product=who.product, serial=who.serial, firmware=who.firmware)
    if len(samples) < 2:
        silent = f"{len(samples)} samples came" if device.period_ns else ""
        return about.model_copy(update={"problem": device.concern() or silent})
    captures, nominal_Hz = np.array([sample.capture_ns for sample in samples]), config.nominal_Hz
    rate_Hz = (len(captures) - 1) / max((captures[-1] - captures[0]) * 1e-9, 1e-9)
    slow = nominal_Hz and abs(rate_Hz - nominal_Hz) > RATE_TOLERANCE * nominal_Hz
    problem = f"rate {rate_Hz:.1f} Hz is not the {nominal_Hz:.1f} Hz asked for" if slow else ""
    first = config.channels[0]
    values = np.array([sample.values[0] for sample in samples])
    latency_ms = float(np.median([sample.arrival_ns - sample.capture_ns for sample in samples])) * 1e-6
    seen = {"rate_Hz": float(rate_Hz), "latency_ms": latency_ms, "problem": device.concern() or problem}
    extent = f"{first.name} {values.min():.3f} to {values.max():.3f}"
    return about.model_copy(update=seen | ({"range": extent} if np.isfinite(values).all() else {}))
