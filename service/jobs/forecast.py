"""How long a job will take: medians over recent jobs of the same kind and size."""

import heapq
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from sqlalchemy import func, select, tuple_
from sqlalchemy.orm import load_only

from service.contract.schemas import Status
from service.jobs.models import BlobRow, JobRow
from service.jobs.table_access import TableAccess

#: Successful jobs that are looked at, newest first, and how many alike an estimate needs.
RECENT, MIN_JOBS = 200, 3
#: Two jobs are of the same size when the bytes of their meshes differ by less than this factor.
SAME_SIZE = 2.0
#: Options that change how long a job takes; others (names, limits, units) do not.
COSTLY = ("preset", "settings", "study")
_NEEDED = (JobRow.tenant, JobRow.type, JobRow.inputs, JobRow.options, JobRow.started_ms, JobRow.finished_ms)


@dataclass(frozen=True, slots=True)
class Forecast:
    """elapsed_s : since the attempt started, or since the job was accepted; ahead : jobs that run before it,
    None unless it waits; left_s : estimate, None without one; based_on : jobs that it is the median of
    """

    elapsed_s: float
    ahead: int | None
    left_s: float | None
    based_on: int


@dataclass(frozen=True, slots=True)
class JobSize:
    """kind : type and costly options; size : bytes of the meshes, None if one is not stored (any more)"""

    kind: str
    size: int | None

    def is_like(self, other: "JobSize") -> bool:
        """Same kind, and about the same size."""
        if self.kind != other.kind or self.size is None or other.size is None:
            return False
        return max(self.size, other.size) <= SAME_SIZE * max(1, min(self.size, other.size))


def seconds_left(durations_s: Sequence[float], elapsed_s: float) -> float | None:
    """Median of what is left of those that ran longer than `elapsed_s`; None if none did."""
    longer = [each for each in durations_s if each > elapsed_s]
    return median(longer) - elapsed_s if longer else None


def seconds_until_start(running_left_s: Sequence[float], ahead: int, each_s: float) -> float:
    """When a waiting job starts: the first free of as many places as jobs run now, after `ahead` others that
    take `each_s` each.
    """
    free = list(running_left_s) or [0.0]
    heapq.heapify(free)
    for _ in range(ahead):
        heapq.heapreplace(free, free[0] + each_s)
    return free[0]


class Forecasts(TableAccess):
    """Estimates for jobs that are not final."""

    def forecast(self, row: JobRow) -> Forecast:
        """The forecast of one job; a final one has nothing left."""
        now = self._clock_ms()
        if row.status.is_final:
            begun, ended = row.started_ms or row.created_ms, row.finished_ms or now
            return Forecast(max(0, ended - begun) / 1000, None, 0.0, 0)
        begun = row.created_ms if row.status is Status.ACCEPTED else row.started_ms or row.created_ms
        elapsed_s = max(0, now - begun) / 1000
        ahead = self._ahead(row) if row.status is Status.ACCEPTED else None
        seen = self._seen()
        mine = self._sizes([row])[0]
        durations = [seconds for size, seconds in seen if size.is_like(mine)]
        if len(durations) < MIN_JOBS:
            return Forecast(elapsed_s, ahead, None, len(durations))
        if ahead is None:
            return Forecast(elapsed_s, None, seconds_left(durations, elapsed_s), len(durations))
        each_s = median(seconds for _, seconds in seen)
        places = [max(0.0, each_s - ran) for ran in self._running_for_s(now)]
        left_s = seconds_until_start(places, ahead, each_s) + median(durations)
        return Forecast(elapsed_s, ahead, left_s, len(durations))

    def _ahead(self, row: JobRow) -> int:
        before = tuple_(JobRow.rank, JobRow.id) < tuple_(row.rank, row.id)
        query = select(func.count()).where(JobRow.status == Status.ACCEPTED, before)
        with self._session() as session:
            return session.scalar(query) or 0

    def _running_for_s(self, now_ms: int) -> list[float]:
        query = select(JobRow.started_ms).where(JobRow.status == Status.RUNNING)
        with self._session() as session:
            return [(now_ms - (ms or now_ms)) / 1000 for ms in session.scalars(query)]

    def _seen(self) -> list[tuple[JobSize, float]]:
        """Recent successful jobs, with the seconds that each took."""
        query = select(JobRow).where(JobRow.status == Status.SUCCESSFUL, JobRow.removed_ms.is_(None))
        with self._session() as session:
            rows = list(
                session.scalars(query.order_by(JobRow.id.desc()).limit(RECENT).options(load_only(*_NEEDED)))
            )
        done = [row for row in rows if row.started_ms is not None and row.finished_ms is not None]
        seconds = [((row.finished_ms or 0) - (row.started_ms or 0)) / 1000 for row in done]
        return list(zip(self._sizes(done), seconds, strict=True))

    def _sizes(self, rows: Sequence[JobRow]) -> list[JobSize]:
        used = [[(row.tenant, blob) for blob in _blobs(row)] for row in rows]
        keys = sorted({key for blobs in used for key in blobs})
        query = select(BlobRow.tenant, BlobRow.id, BlobRow.size)
        with self._session() as session:
            found = session.execute(query.where(tuple_(BlobRow.tenant, BlobRow.id).in_(keys))) if keys else ()
            sizes = {(tenant, blob): size for tenant, blob, size in found}
        known = [[sizes.get(key) for key in blobs] for blobs in used]
        return [
            JobSize(_kind(row), None if None in each else sum(size or 0 for size in each))
            for row, each in zip(rows, known, strict=True)
        ]


def _blobs(row: JobRow) -> list[str]:
    """Of the meshes that are there; one at an address that is not fetched yet counts as unknown."""
    sources: list[Mapping[str, Any]] = [each for each in row.inputs.values() if each]
    return [str(source.get("blob")) for source in sources]


def _kind(row: JobRow) -> str:
    options = row.options or {}
    return json.dumps([row.type, *(options.get(name) for name in COSTLY)], sort_keys=True)
