"""Looks at each device by itself, without moving anything: who it is, what rate, noise, latency and range it has."""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from typing import TypeVar

import numpy as np

from controller.devices.drivers import open_axis, open_force, open_tracker
from controller.devices.guard import RATE_TOLERANCE, UNDATED
from controller.inputs.examination import look_at
from controller.loop.realtime import promptly
from drivers.roles import Device, Identity, OnBus, ServoAxis
from rig.channels import AxisSample, ForceSample, MarkerSample
from rig.config.force_map import CHANNELS
from rig.config.products.roles import Product
from rig.config.wiring import Wiring
from rig.errors import RigError
from rig.progress import Progress, silent
from rig.results.bench import DeviceReport

LOOKS = 3
LISTEN_S = 2.0  # 120 frames of a tracker, whose noise is then known to 7 %
PERIOD_S = 0.001

AnySample = ForceSample | AxisSample | MarkerSample
Samples = Sequence[AnySample]
AnyDevice = TypeVar("AnyDevice", bound=Device)
Listen = Callable[[AnyDevice], Samples]


def examine(wiring: Wiring, seconds: float = LISTEN_S, tell: Progress = silent) -> tuple[DeviceReport, ...]:
    """One finding a configured device; a device that fails is a finding with a problem, not an error.

    They are listened to at the loop's priority, as the loop will; a rate is wrong where it was in each of ``LOOKS``.
    """
    with promptly(wiring.loop.priority):
        return _examined(wiring, seconds, tell)


def _examined(wiring: Wiring, seconds: float, tell: Progress) -> tuple[DeviceReport, ...]:
    force, axis, tracker = wiring.force, wiring.axis, wiring.tracker
    channel = CHANNELS.index(force.axis)
    tell("force", 0.0)
    findings = [_look("force", force, lambda: open_force(force), lambda device: _listen(device.poll, seconds), channel)]
    tell("axis", 1 / 3)
    opener = partial(open_axis, axis, wiring.limits, 1 / PERIOD_S)
    findings.append(_look("axis", axis, opener, partial(_poll_axis, seconds)))
    if tracker:
        tell("tracker", 2 / 3)
        findings.append(
            _look("tracker", tracker, lambda: open_tracker(tracker), lambda device: _listen(device.poll, seconds))
        )
    findings += [look_at(name, one, seconds) for name, one in wiring.input.items()]
    return tuple(findings)


def _look(
    role: str, config: Product, opener: Callable[[], AnyDevice], listen: Listen[AnyDevice], channel: int = 0
) -> DeviceReport:
    try:
        with closing(opener()) as device:
            device.start()
            return _heard(role, device, listen, channel)
    except RigError as error:
        return DeviceReport(role=role, problem=str(error), advice=config.advice)


def _heard(role: str, device: AnyDevice, listen: Listen[AnyDevice], channel: int) -> DeviceReport:
    for _ in range(LOOKS):
        found = _finding(role, device.identity, 1e9 / device.period_ns, listen(device), channel)
        if not found.problem:
            break
    about = {"bus": device.bus if isinstance(device, OnBus) else "", "settings": device.identity.settings}
    return found.model_copy(update={"problem": found.problem or device.counters.trouble, **about})


def _listen(poll: Callable[[int], Samples], seconds: float) -> Samples:
    found: list[AnySample] = []
    end_ns = time.monotonic_ns() + round(seconds * 1e9)
    while (now_ns := time.monotonic_ns()) < end_ns:
        found.extend(poll(now_ns))
        time.sleep(PERIOD_S)
    return found


def _poll_axis(seconds: float, device: ServoAxis) -> Samples:
    def ask(now_ns: int) -> Samples:
        device.request(now_ns)
        return device.poll(now_ns)

    return _listen(ask, seconds)


def _finding(role: str, identity: Identity, nominal_Hz: float, samples: Samples, channel: int) -> DeviceReport:
    about = DeviceReport(role=role, product=identity.product, serial=identity.serial, firmware=identity.firmware)
    valid = [sample for sample in samples if sample.valid]
    if len(valid) < 2:
        return about.model_copy(update={"problem": f"{len(samples)} samples came, {len(valid)} of them valid"})
    captures = np.unique([sample.capture_ns for sample in samples])
    rate_Hz = (len(captures) - 1) / ((captures[-1] - captures[0]) * 1e-9)
    latency_ms = float(np.median([sample.arrival_ns - sample.capture_ns for sample in samples])) * 1e-6
    noise, extent = _spread(valid, channel)
    slow = role != "axis" and abs(rate_Hz - nominal_Hz) > RATE_TOLERANCE * nominal_Hz
    problem = f"rate {rate_Hz:.1f} Hz is not the {nominal_Hz:.1f} Hz asked for" if slow else ""
    streams = {sample.tool if isinstance(sample, MarkerSample) else 0 for sample in samples}
    if slow and (1 - RATE_TOLERANCE) * len(samples) / len(streams) > len(captures):
        problem = UNDATED
    seen = {"rate_Hz": float(rate_Hz), "latency_ms": latency_ms, "noise": noise, "range": extent, "problem": problem}
    return about.model_copy(update=seen)


def _spread(samples: Samples, channel: int) -> tuple[str, str]:
    """Noise and range in words: force along the configured channel, position, or the first tool's depth axis."""
    first = samples[0]
    if isinstance(first, ForceSample):
        values, unit = np.array([s[4:7][channel] for s in samples if isinstance(s, ForceSample)]), "N"
    elif isinstance(first, AxisSample):
        values, unit = np.array([s.position_mm for s in samples if isinstance(s, AxisSample)]), "mm"
    else:
        values, unit = np.array([s.z_mm for s in samples if isinstance(s, MarkerSample) and s.tool == first.tool]), "mm"
    # Successive differences: a slow drift of what is measured is not noise of the device.
    noise = float(np.std(np.diff(values)) / np.sqrt(2)) if len(values) > 2 else 0.0
    return f"{noise:.4f} {unit}", f"{values.min():.3f} to {values.max():.3f} {unit}"
