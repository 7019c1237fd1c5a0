"""Calibrations: those that the bench uses, and those that lie beside them."""

from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

from fastapi import APIRouter
from pydantic import BaseModel, Field

from api.catalogue.pages import Place
from api.http.access.rights import READ
from api.http.listing import Listing, listing
from api.http.routes.common import PageQuery, Word
from api.http.service import Service
from api.operations.calibrations import FOLDER
from rig.config.axis_dynamics import AxisDynamics
from rig.config.calibration import AnyCalibration, Calibration, ForceCalibration, What, what_of
from rig.config.calibration_files import read_axis, read_dynamics, read_force
from rig.errors import RigError, UsageError
from rig.results.catalogue import Text

READERS: Mapping[What, Callable[[Path], AnyCalibration]] = {
    "force": read_force, "axis": read_axis, "dynamics": read_dynamics,
}  # fmt: skip


class CalibrationView(BaseModel):
    """One calibration; of a file that cannot be read only its name and why."""

    what: What
    used: bool = Field(description="the bench measures with it now")
    file: Text = Field(description="empty: the simulated bench's own")
    product: str = ""
    serial: str = ""
    date: str = ""
    uncertainty_percent: float | None = Field(default=None, description="relative standard uncertainty")
    refused: Text = Field(description="why the bench would not use it; empty if it would")


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""

    @router.get(
        "/calibrations", dependencies=[READ], summary="Calibrations in use, then those in their folder, newest first"
    )
    def calibrations(
        page: PageQuery, what: What | None = None, used: bool | None = None, product: Word = "", serial: Word = ""
    ) -> Listing[CalibrationView]:
        stated, now = service.wiring.calibration, datetime.now(UTC)
        using = list(_used(stated, now))
        taken = {Path(one.file).resolve() for one in using if one.file}
        lying = (one for one in _lying(stated, now) if Path(one.file).resolve() not in taken)
        wanted: Mapping[str, str | bool | None] = {"what": what, "used": used, "product": product, "serial": serial}
        return listing("calibrations", [*using, *lying], page, _place, newest_first=True, **wanted)


def _place(one: CalibrationView) -> Place:
    return f"{one.used:d} {one.date}", f"{one.what} {Path(one.file).name}"


def _used(stated: Calibration, now: datetime) -> Iterator[CalibrationView]:
    files, read = (stated.force, stated.axis, stated.dynamics), (stated.of_force, stated.of_axis, stated.of_dynamics)
    for file, found in zip(files, read, strict=True):
        if found:
            yield _view(file, found, stated, now, used=True)


def _lying(stated: Calibration, now: datetime) -> Iterator[CalibrationView]:
    for what, read in READERS.items():
        for path in FOLDER.glob(f"{what}-*.json"):
            try:
                if path.is_fifo() or path.is_char_device():  # whose end does not come
                    raise UsageError(f"{path}: is no file")
                yield _view(path, read(path), stated, now)
            except RigError as error:
                yield CalibrationView(what=what, used=False, file=str(path), refused=str(error))


def _view(
    file: Path | None, found: AnyCalibration, stated: Calibration, now: datetime, used: bool = False
) -> CalibrationView:
    return CalibrationView(
        what=what_of(found),
        used=used,
        file=str(file or ""),
        product=found.product,
        serial=found.serial,
        date=found.date.isoformat(),
        uncertainty_percent=100 * _share(found),
        refused="; ".join(stated.alone(found).unfit(now)),
    )


def _share(found: AnyCalibration) -> float:
    """Relative standard uncertainty; of dynamics that of delay and lags together, half of what 95 % lie within."""
    if isinstance(found, AxisDynamics):
        return 0.5 * found.total.within_s / found.total.s
    return found.uncertainty.combined if isinstance(found, ForceCalibration) else found.uncertainty / found.scale
