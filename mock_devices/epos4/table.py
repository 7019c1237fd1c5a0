"""The EPOS4's object dictionary: every object of the maker's data sheet (firmware 0140), two that came later, and what
a drive holds that was set up for a motor."""

from pathlib import Path

from drivers.epos4.objects import DEVICE_NAME, I32_MAX, I32_MIN, PRODUCT, REVISION, SERIAL, TEXT, U8, VENDOR, Entry
from mock_devices.cia402.table import ObjectTable, read_objects

LATER = (
    Entry(0x100A, 0, "software version", TEXT, "const"),
    Entry(0x1029, 0, "error behaviour entries", U8, "const", 1),
    Entry(0x1029, 1, "behaviour on communication error", U8, "rw", 0, 0, 2),
)
RATED_TORQUE_uN_m, TORQUE_CONSTANT_uN_m_A = 128_000, 36_900
EPOS4 = ObjectTable(
    read_objects(Path(__file__).parent / "dictionary.csv") | {(entry.index, entry.sub): entry for entry in LATER},
    delivered={
        (0x1000, 0): 0x0002_0192,
        **{(entry.index, entry.sub): int(entry.default) for entry in (VENDOR, PRODUCT, REVISION, SERIAL)},
        (0x3001, 2): 10_000,
        (0x3001, 5): TORQUE_CONSTANT_uN_m_A,
        (0x6076, 0): RATED_TORQUE_uN_m,
        (0x607D, 1): I32_MIN,
        (0x607D, 2): I32_MAX,
        (0x6502, 0): 0x3A5,
    },
    texts={(0x1008, 0): str(DEVICE_NAME.default), (0x100A, 0): "0x0170"},
)
