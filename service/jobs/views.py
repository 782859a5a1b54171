"""From rows to what clients see."""

from datetime import UTC, datetime
from typing import Any

from service.contract.schemas import FileEntry, FileList, Job, JobForecast, JobInputs, Links, Options, Problem
from service.jobs.forecast import Forecast
from service.jobs.models import JobRow


def job_of(row: JobRow) -> Job:
    """The status document of a job."""
    address = f"/v1/jobs/{row.id}"
    return Job.model_validate(
        {
            "id": row.id,
            "type": row.type,
            "status": row.status,
            "stage": row.stage,
            "progress": round(row.progress, 1),
            "message": row.message,
            "label": row.label,
            "verdict": row.verdict,
            "decision": row.decision,
            "within": row.within,
            "batch_id": row.batch_id,
            "reference": row.options.get("reference") if row.options else None,
            "inputs": {name: _input_of(row.inputs.get(name)) for name in JobInputs.model_fields},
            "created": time_of(row.created_ms),
            "started": time_of(row.started_ms),
            "finished": time_of(row.finished_ms),
            "attempt": row.attempt,
            "error": Problem.model_validate(row.error) if row.error else None,
            "links": Links(self=address, results=f"{address}/results", files=f"{address}/files"),
        }
    )


def _input_of(source: dict[str, Any] | None) -> dict[str, Any] | None:
    """The address without its query: it may hold a signature."""
    if source is None:
        return None
    url = source.get("url")
    return {
        "blob": source.get("blob"),
        "filename": source.get("filename"),
        "url": url and _without_query(url),
    }


def _without_query(url: str) -> str:
    return url.partition("?")[0].partition("#")[0]


def options_of(row: JobRow) -> Options:
    """What was asked of a job. The address of a webhook has no query: it may hold a secret."""
    asked = dict(row.options)
    if asked.get("webhook"):
        asked["webhook"] = {"url": _without_query(asked["webhook"]["url"])}
    return Options.model_validate(asked)


def forecast_of(found: Forecast) -> JobForecast:
    """The forecast of a job, in tenths of a second."""
    return JobForecast(
        elapsed_s=round(found.elapsed_s, 1),
        place=None if found.ahead is None else found.ahead + 1,
        remaining_s=None if found.left_s is None else round(found.left_s, 1),
        based_on=found.based_on,
    )


def files_of(row: JobRow) -> FileList:
    """The files of a successful job."""
    address = f"/v1/jobs/{row.id}/files"
    return FileList(
        files=[FileEntry(**entry, href=f"{address}/{entry['name']}") for entry in row.files or []]
    )


def time_of(ms: int | None) -> datetime | None:
    """A table's time as a date and time in UTC."""
    return None if ms is None else datetime.fromtimestamp(ms / 1000, UTC)
