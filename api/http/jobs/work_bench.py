"""Jobs at the bench while the service does not use it itself."""

from api.http.jobs.params import NothingAsked
from api.http.jobs.worker import Desk
from api.operations import doctor as examination
from controller.operation import Operation
from rig.results.bench import DoctorResult


def doctor(operation: Operation, _asked: NothingAsked, desk: Desk) -> DoctorResult:
    """Looks at each device for two seconds."""
    return examination.doctor(operation, desk.wiring)
