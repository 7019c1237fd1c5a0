"""Every problem has a page, and the page of each is reached by its type."""

import re
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.explained import EXPLAINED
from tests.api.jobs import conftest

service, client = conftest.service, conftest.client
SOURCES = Path(__file__).parents[2] / "api" / "http"
CODE = re.compile(r'(?:RequestRefused|PlaceRefused|answer)\(\s*\d+, "([a-z-]+)"')


def codes() -> set[str]:
    """All that stand in the sources."""
    return {code for file in SOURCES.rglob("*.py") for code in CODE.findall(file.read_text())}


def test_every_code_of_the_service_is_explained_and_no_other() -> None:
    assert len(codes()) > 40
    assert codes() - EXPLAINED.keys() == set()
    never = {code for code in EXPLAINED if not any(f'"{code}"' in file.read_text() for file in SOURCES.rglob("*.py")
             if file.name != "explained.py")}  # fmt: skip
    assert never == set()


def test_the_type_of_a_problem_leads_to_its_page(client: TestClient) -> None:
    problem = client.get("/api/v1/jobs/none").json()
    page = client.get(problem["type"], headers={"Authorization": ""})
    assert page.status_code == 200 and page.headers["content-type"].startswith("text/html")
    assert EXPLAINED["no-such-job"][1] in page.text


@pytest.mark.parametrize(("code", "status"), [("force_limit", 404), ("<script>", 422), ("x" * 41, 422)])
def test_what_is_no_problem_says_so(client: TestClient, code: str, status: int) -> None:
    answer = client.get(f"/api/v1/problems/{code}")
    assert answer.status_code == status and "<script>" not in answer.text
