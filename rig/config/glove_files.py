"""Calibration files of gloves, named in their tables."""

from collections.abc import Callable
from pathlib import Path

from rig.config.calibration_files import read_glove
from rig.config.products.firmata_glove import FirmataGlove
from rig.config.wiring import Wiring


def with_gloves(wiring: Wiring) -> Wiring:
    """``wiring`` with what the calibration files of its gloves hold; raises UsageError naming one that is malformed."""

    def read(name: str, file: Path) -> dict[str, object]:
        return {"of_fingers": read_glove(file, f"input.{name}.calibration")}

    return _changed(wiring, read)


def gloves_beside(wiring: Wiring, folder: Path) -> Wiring:
    """``wiring`` with paths of these files as they are from ``folder``."""
    return _changed(wiring, lambda _, file: {"calibration": folder / file})


def _changed(wiring: Wiring, change: Callable[[str, Path], dict[str, object]]) -> Wiring:
    inputs = dict(wiring.input)
    for name, product in wiring.input.items():
        if isinstance(product, FirmataGlove) and product.calibration:
            inputs[name] = product.model_copy(update=change(name, product.calibration))
    return wiring.model_copy(update={"input": inputs})
