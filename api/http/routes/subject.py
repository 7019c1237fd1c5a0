"""Who lies under the tip: kept with each recording, and the force that none may pass. Until the service ends."""

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from api.catalogue.catalogue import Catalogue, code_of
from api.http.access.rights import OPERATE, READ
from api.http.models import RequestBody
from api.http.problems import responses
from api.http.routes.common import LeaseHeader, MatchHeader, etag_of, refuse_stale
from api.http.service import Service
from rig.config.subject import HIGHEST_SITE_N

SiteThresholds = Annotated[dict[str, Annotated[float, Field(gt=0, le=HIGHEST_SITE_N)]], Field(max_length=200)]


class SubjectSettings(RequestBody):
    """Subject, site and the force that none may pass, beside limits.force_N; at its site the lower of two holds."""

    id: str = Field(min_length=1, max_length=80, description="a code, no person's name", examples=["S01"])
    site: str = Field(min_length=1, max_length=80, examples=["left forearm"])
    pain_threshold_N: float = Field(gt=0, le=1000, examples=[8.5])
    site_thresholds_N: SiteThresholds | None = Field(
        default=None,
        description="at single sites; left out: as they are, or, for another subject, as its sessions found them last",
        examples=[{"left forearm": 7.9}],
    )


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""

    lists = Catalogue(service.sessions)

    def shown(response: Response) -> SubjectSettings:
        found = SubjectSettings(**service.wiring.subject.model_dump(include=set(SubjectSettings.model_fields)))
        response.headers["ETag"] = etag_of(found)
        return found

    @router.get("/subject", dependencies=[READ], summary="The subject on the bench; its ETag is asked for by a change")
    async def subject(response: Response) -> SubjectSettings:
        return shown(response)

    @router.put(
        "/subject",
        dependencies=[OPERATE],
        summary="Changes the subject; another threshold starts the loop anew, which homes the axis",
        responses=responses("409 busy", "409 stopped", "412 stale", "422 refused", "428 if-match"),
    )
    def change(
        wanted: SubjectSettings, response: Response, lease: LeaseHeader = "", match: MatchHeader = ""
    ) -> SubjectSettings:
        service.control.check(lease)
        refuse_stale(match, etag_of(shown(response)), "/subject")
        given = wanted.model_dump(exclude_none=True) | {"id": code_of(wanted.id)}
        if given["id"] != service.wiring.subject.id:
            given.setdefault("site_thresholds_N", lists.site_thresholds_N(given["id"], HIGHEST_SITE_N))
        service.use_subject(service.wiring.subject.model_copy(update=given), lease)
        return shown(response)
