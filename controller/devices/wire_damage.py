"""How much of what came over the wires of a program's devices was damaged or foreign."""

from collections.abc import Mapping
from dataclasses import replace

from drivers.roles import Device, LinkCounters


class WireDamage:
    """Counters of all devices since ``begin``; a device that was opened anew meanwhile counts from its own start."""

    def __init__(self) -> None:
        self._before: dict[str, tuple[Device, LinkCounters]] = {}

    def begin(self, devices: Mapping[str, Device]) -> None:
        """A program starts."""
        self._before = {role: (device, replace(device.counters)) for role, device in devices.items()}

    def shares(self, devices: Mapping[str, Device]) -> dict[str, float]:
        """By role: failed checksums and discarded bytes for each message that was good."""
        return {role: self._share(role, device) for role, device in devices.items()}

    def _share(self, role: str, device: Device) -> float:
        known, before = self._before.get(role, (None, LinkCounters()))
        before, now = before if known is device else LinkCounters(), device.counters
        damaged = now.checksum_errors + now.discarded_bytes - before.checksum_errors - before.discarded_bytes
        return damaged / max(now.frames - before.frames, 1)
