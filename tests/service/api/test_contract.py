"""Requests made from the OpenAPI document, valid and not: every answer is one that the document names, none
is a 5xx.

A few requests an address in a plain run; `CUSP_TEST_NIGHTLY=1` makes twenty times as many, and all of those
by the book.
"""

import gzip
import hashlib
import os
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import requests
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import CHECKS as ALL_CHECKS
from schemathesis.checks import load_all_checks

from service.api.app import create_app
from service.api.digests import content_digest
from service.auth.keys import KeyStore, Scope
from service.contract.schemas import Options
from service.jobs.models import DEFAULT_TENANT, JobRow, new_id
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.database import migrate, open_database
from tests.support.service import TRIANGLE_OBJ, serving

AT_NIGHT = bool(os.environ.get("CUSP_TEST_NIGHTLY"))
pytestmark = [pytest.mark.nightly] if AT_NIGHT else []
EXAMPLES = 300 if AT_NIGHT else 15
#: By the book these make thousands of requests, which take seconds to invent, in each process that collects
#: the tests: at night only.
LARGE_BODIES = ["/v1/batches", "/v1/designs/{blob}/characteristics"]
#: Two jobs that are there: one that waits, one that is successful without files.
IDS = [new_id(), new_id()]
load_all_checks()
CHECKS = ALL_CHECKS.get_by_names(
    [
        "not_a_server_error",
        "status_code_conformance",
        "content_type_conformance",
        "response_schema_conformance",
    ]
)

document = create_app(ServiceSettings.model_construct()).openapi()
schema = schemathesis.openapi.from_dict(document)
schema.config.phases.coverage.enabled = False  # it cannot make the form: "Unsupported type: Binary"


#: The same by the book: each bound of each parameter, from both sides. Of all but the form, which it cannot
#: make.
covered = schemathesis.openapi.from_dict(document).exclude(path="/v1/jobs", method="POST")
if not AT_NIGHT:
    covered = covered.exclude(path=LARGE_BODIES, method=["POST", "PUT"])
covered.config.phases.coverage.enabled = True
covered.config.phases.examples.enabled = False  # those above are the same
covered.config.phases.fuzzing.enabled = False


@covered.hook
@schema.hook
def map_path_parameters(_: Any, parameters: dict[str, Any] | None) -> dict[str, Any] | None:
    """Ids by chance are all unknown: two of three become ones that are there."""
    if parameters and "job_id" in parameters:
        choice = zlib.crc32(repr(sorted(parameters.items())).encode()) % 3
        if choice < len(IDS):
            parameters["job_id"] = IDS[choice]
    return parameters


@schemathesis.hook
def before_call(_: Any, case: Any, __: Any) -> None:
    """Of raw bodies some go packed, some with a digest, right or wrong."""
    if case.media_type != "application/octet-stream" or not hasattr(case.body, "data"):
        return
    content: bytes = case.body.data
    draw = sent.total()
    if draw % 3 == 0:
        packed = gzip.compress(content)
        case.body = type(case.body)(packed if draw // 3 % 2 else packed[:-3])
        case.headers["Content-Encoding"] = "gzip"
    elif draw % 3 == 1:
        digest = hashlib.sha256(content if draw // 3 % 2 else b"other").hexdigest()
        case.headers["Content-Digest"] = content_digest(digest)
    sent[draw % 3] += 1


sent: Counter[int] = Counter()


@pytest.fixture(scope="module")
def session() -> Iterator[requests.Session]:
    """One connection for all requests."""
    with requests.Session() as made:
        made.trust_env = False  # no proxy
        yield made


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A service without keys."""
    with filled(tmp_path_factory) as (served, _):
        yield served


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    """A service with keys, and a key that may do all."""
    with filled(tmp_path_factory) as (served, made):
        engine = open_database(made.database)
        _, key = KeyStore(engine).create(DEFAULT_TENANT, [Scope.ADMIN])
        engine.dispose()
        yield served, key


@contextmanager
def filled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, ServiceSettings]]:
    """A service with two jobs."""
    made = ServiceSettings(
        data_dir=tmp_path_factory.mktemp("contract") / "data", max_upload_mib=1, rate_limit_per_s=0
    )
    made.make_folders()
    migrate(made.database)
    engine = open_database(made.database)
    jobs = JobStore(engine)
    jobs.worker_beat("worker-1")
    options = Options().model_dump(mode="json")
    for job_id in IDS:
        blob = {"blob": f"sha256:{0:064}", "filename": None}
        inputs = {"design": blob, "scan": blob}
        jobs.add(JobRow(id=job_id, type="registration", inputs=inputs, options=options, attempt=0, crashes=0))
    assert jobs.claim(IDS[1], "worker-1") is not None and jobs.succeed(IDS[1], 1, [])
    # a probe of the service asks whether a worker lives: for as long as this takes, one does
    jobs_later = JobStore(engine, lambda: 2**52)
    jobs_later.worker_beat("worker-1")
    with serving(create_app(made)) as served:
        yield served, made
    engine.dispose()


@schema.parametrize()
@settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize=not AT_NIGHT,
    suppress_health_check=list(HealthCheck),
)
def test_no_answer_is_undocumented(case: Any, address: str, session: requests.Session) -> None:
    case.call_and_validate(base_url=address, session=session, checks=CHECKS)


@covered.parametrize()
@settings(max_examples=EXAMPLES, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
def test_no_answer_to_a_caller_with_a_key_is_undocumented(
    case: Any, guarded: tuple[str, str], session: requests.Session
) -> None:
    where, key = guarded
    headers = {"Authorization": f"Bearer {key}"}
    case.call_and_validate(base_url=where, session=session, checks=CHECKS, headers=headers)


def test_bodies_were_sent_plain_packed_and_with_a_digest() -> None:
    assert set(sent) == {0, 1, 2}, sent


def test_the_service_is_whole_after_all_that(address: str) -> None:
    import httpx

    with httpx.Client(base_url=address) as http:
        assert http.get("/readyz").status_code == 200
        files = {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ)}
        assert http.post("/v1/jobs", files=files).status_code == 202
