"""The settings of a simulated Zaber device: what can be read, and of that what can be written."""

from mock_devices.zaber.commands import Refused

DEVICE_ID, FIRMWARE, BUILD = 50952, "7.40", 18000
WRITABLE = {
    "comm.checksum": 0.0,
    "comm.alert": 0.0,
    "limit.min": 0.0,
    "limit.max": 140_000.0,
    "limit.approach.maxspeed": 65_536.0,
    "maxspeed": 196_608.0,
    "accel": 655.0,
}
READABLE = {
    "comm.packet.size.max": "80",
    "comm.command.packets.max": "1",
    "comm.word.size.max": "50",
    "get.settings.max": "10",
    "system.axiscount": "1",
    "deviceid": str(DEVICE_ID),
    "version": FIRMWARE,
    "version.build": str(BUILD),
    "device.hw.modified": "0",
    "resolution": "64",
    "peripheralid": "0",
    "peripheral.serial": "0",
}
NOT_NEGATIVE = ("comm.checksum", "comm.alert", "limit.approach.maxspeed", "maxspeed", "accel")


class ZaberSettings:
    """``values`` holds those that can be written; they outlive a restart."""

    def __init__(self, serial_number: int) -> None:
        self.device = 1
        self.values = dict(WRITABLE)
        self._fixed = READABLE | {"system.serial": str(serial_number)}

    def text(self, name: str) -> str:
        """What `get` answers; raises Refused."""
        if name in self.values:
            return f"{self.values[name]:.0f}"
        if name not in self._fixed:
            raise Refused("BADCOMMAND")
        return self._fixed[name]

    def write(self, name: str, value: float) -> None:
        """What `set` does; raises Refused."""
        if name not in self.values:
            raise Refused("BADCOMMAND")
        low = (value < 0 and name in NOT_NEGATIVE) or (name == "accel" and not value)
        if low or (name.startswith("comm.") and value not in (0, 1)):
            raise Refused("BADDATA")
        self.values[name] = value
