"""The user parameters of the mock tracker: what GET, SET and GETINFO read and write."""

from fnmatch import fnmatchcase

from mock_devices.ndi.port_handles import CommandRefused

NO_SUCH, BAD_VALUE, OUT_OF_RANGE, DENIED = 0x34, 0x35, 0x36, 0x39
FIRMWARE, FIRMWARE_VERSION = "Features.Firmware.Version", "007.000.012"
# What may be set, and within which bounds; frequencies as a Vega ST offers them.
BOUNDS = {
    "Param.Tracking.Frame Frequency": (20, 60),
    "Param.Tracking.Track Frequency": (0, 2),
    "Param.Tracking.Selected Volume": (0, 1),
    "Param.Default Wavelength.Return Warning": (0, 1),
    "Param.Simulated Alerts": (0, 0xFFFF),
    "Param.Bump Detector.Bump Detection": (0, 1),
}


class UserParameters:
    """Names and values; an asterisk in a name asks for all that fit, as the tracker has it."""

    def __init__(self, serial: str, model: str) -> None:
        self._values = {
            FIRMWARE: FIRMWARE_VERSION,
            "Features.Hardware.Serial Number": serial,
            "Features.Hardware.Model": model,
            "Features.Hardware.Characterization Date": "01/02/03",
            "Features.Tools.Enabled Tools": "24",
            "Info.Status.System Mode": "Initialized",
            "Info.Status.Alerts": "0",
            "Param.Tracking.Frame Frequency": "60",
            "Param.Tracking.Track Frequency": "0",
            "Param.Tracking.Selected Volume": "0",
            "Param.Default Wavelength.Return Warning": "1",
            "Param.Simulated Alerts": "0",
            "Param.Bump Detector.Bump Detection": "1",
        }

    def get(self, params: str) -> str:
        """GET: a line ``name=value`` for each that fits."""
        return "\n".join(f"{name}={self._values[name]}" for name in self._fitting(params))

    def set(self, params: str) -> str:
        """SET: ``name=value``; what is measured or built in is nobody's to set."""
        name, _, value = params.partition("=")
        if name not in self._values:
            raise CommandRefused(NO_SUCH)
        if name not in BOUNDS:
            raise CommandRefused(DENIED)
        if not value.isdecimal():
            raise CommandRefused(BAD_VALUE)
        low, high = BOUNDS[name]
        if not low <= int(value) <= high:
            raise CommandRefused(OUT_OF_RANGE)
        self._values[name] = str(int(value))
        return "OKAY"

    def describe(self, params: str) -> str:
        """GETINFO: value, type, access, smallest, largest, and a text for each that fits."""
        return "\n".join(map(self._described, self._fitting(params or FIRMWARE)))

    def _described(self, name: str) -> str:
        low, high = BOUNDS.get(name, (0, 12))
        return f"{name}={self._values[name]};3;{3 if name in BOUNDS else 1};{low};{high};;{name.rpartition('.')[2]}"

    def _fitting(self, pattern: str) -> list[str]:
        found = [name for name in self._values if fnmatchcase(name, pattern)] if pattern else []
        if not found:
            raise CommandRefused(NO_SUCH)
        return found
