"""Who the axis is, and the limits that the device itself keeps; a setting is written only where it differs.

ZaberSettings outlive the power, and the memory behind them wears: hence the look before each write.
"""

import statistics
import time

from drivers.roles import Identity
from drivers.zaber.codec import Scale
from drivers.zaber.dialogue import AsciiDialogue
from rig.config.products.zaber_ascii import ZaberWiring
from rig.config.wiring import Limits
from rig.errors import DeviceError

FIRMWARE_MIN = 7.0  # from it on a move has a speed of its own
ROUND_TRIPS = 9


def identify(dialogue: AsciiDialogue, config: ZaberWiring) -> Identity:
    """Raises DeviceError where the firmware is too old, or the line too slow for ``axis.rate_Hz``."""
    version = dialogue.value("version")
    try:
        known = float(version)
    except ValueError:
        known = 0.0
    if known < FIRMWARE_MIN:
        raise DeviceError(
            f"{dialogue.name}: firmware {version!r} gives a move no speed of its own; {FIRMWARE_MIN:g} or newer is"
            " needed"
        )
    round_trip_s = _round_trip_s(dialogue)
    if round_trip_s * config.rate_Hz > 1.0:
        raise DeviceError(
            f"{dialogue.name}: a reply takes {1000 * round_trip_s:.1f} ms, too long for axis.rate_Hz"
            f" {config.rate_Hz:g}; lower it to {0.8 / round_trip_s:.0f}, or raise axis.baud in device and configuration"
        )
    settings = {"device id": dialogue.value("deviceid"), "round trip": f"{1000 * round_trip_s:.1f} ms"}
    return Identity(config.product, dialogue.value("system.serial"), version, settings)


def _round_trip_s(dialogue: AsciiDialogue) -> float:
    taken_s = []
    for _ in range(ROUND_TRIPS):
        begin_s = time.perf_counter()
        dialogue.value("pos")
        taken_s.append(time.perf_counter() - begin_s)
    return statistics.median(taken_s)


def configure(dialogue: AsciiDialogue, config: ZaberWiring, limits: Limits) -> None:
    """Checksums on, then the limits; each is read back."""
    _set(dialogue, "comm.checksum", 1)
    dialogue.decoder.demanding = True
    scale = Scale(config.increments_per_mm, config.direction)
    ends = sorted((scale.steps(limits.position_min_mm), scale.steps(limits.position_max_mm)))
    wanted = {
        "limit.min": ends[0],
        "limit.max": ends[1],
        "maxspeed": scale.speed(limits.speed_mm_s),
        "limit.approach.maxspeed": scale.speed(config.homing_speed_mm_s),
        "accel": scale.acceleration(config.acceleration_mm_s2),
    }
    for setting, value in wanted.items():
        _set(dialogue, setting, value)


def _set(dialogue: AsciiDialogue, setting: str, value: int) -> None:
    if dialogue.value(setting) == str(value):
        return
    dialogue.ask(f"set {setting} {value}")
    if (kept := dialogue.value(setting)) != str(value):
        raise DeviceError(f"{dialogue.name}: {setting} was set to {value} and is {kept}; check the limits against it")
