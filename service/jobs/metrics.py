"""Metrics for Prometheus. Counters are in the database, since the API and the workers are several processes.

Gauges of the queue are computed from the table of jobs on each request.
"""

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from sqlalchemy import Engine, Float, String, func, select, text, type_coerce
from sqlalchemy.orm import Mapped, Session, mapped_column, sessionmaker

from service.contract.schemas import Status
from service.jobs.clock import clock_of
from service.jobs.liveness import DEAD_AFTER_MS
from service.jobs.models import Base, JobRow, WorkerRow

#: name -> its label, what it counts
COUNTERS: dict[str, tuple[str, str]] = {
    "cusp_jobs_ended": (
        "outcome",
        "jobs that ended: successful, dismissed, handed_back, or the code of the problem",
    ),
    "cusp_decisions": ("decision", "registrations by the decision on the part: pass, fail or not_judged"),
    "cusp_stage_seconds": ("stage", "seconds that jobs spent in a stage of the method"),
    "cusp_stage_passes": ("stage", "passages through a stage, to divide the seconds by"),
    "cusp_uploads": ("format", "meshes received"),
    "cusp_upload_bytes": ("format", "bytes of meshes received"),
    "cusp_uploads_refused": ("reason", "uploads and jobs refused for lack of room: disk or quota"),
    "cusp_designs": ("known", "registrations by whether the analysis of their design was kept: yes or no"),
}
PEAK = "cusp_child_peak_mib"


class CounterRow(Base):
    """One sum, or for `PEAK` one maximum."""

    __tablename__ = "counters"

    name: Mapped[str] = mapped_column(String(64), primary_key=True)
    label: Mapped[str] = mapped_column(String(64), primary_key=True)
    value: Mapped[float] = mapped_column(Float)


_ADD = text(
    "INSERT INTO counters (name, label, value) VALUES (:name, :label, :value) "
    "ON CONFLICT (name, label) DO UPDATE SET value = counters.value + excluded.value"
)
_RAISE = text(
    "INSERT INTO counters (name, label, value) VALUES (:name, :label, :value) "
    "ON CONFLICT (name, label) DO UPDATE SET value = "
    "CASE WHEN excluded.value > counters.value THEN excluded.value ELSE counters.value END"
)


def count(session: Session, name: str, label: str, amount: int = 1) -> None:
    """Add to a counter in the transaction of the counted event, so that both are stored or none."""
    session.execute(_ADD, {"name": name, "label": label[:64], "value": amount})


class Metrics(Collector):
    """Metrics of one database. Safe to share between threads and processes."""

    def __init__(self, engine: Engine, data_dir: Path) -> None:
        self._engine, self._data_dir = engine, data_dir
        self._session = sessionmaker(engine)
        self._clock_ms = clock_of(engine)

    def add(
        self,
        amounts: Mapping[str, Mapping[str, float]],
        peaks_mib: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        """Add to counters, in one transaction: a commit waits for the disk.

        amounts : by name and label; peaks_mib : most memory of a job's process, by type of the job
        """
        assert amounts.keys() <= COUNTERS.keys(), amounts  # noqa: S101 (a name that nobody would see)
        added = [
            {"name": name, "label": label[:64], "value": value}
            for name, by_label in sorted(amounts.items())
            for label, value in sorted(by_label.items())
        ]
        raised = [{"name": PEAK, "label": label, "value": mib} for label, mib in sorted(peaks_mib.items())]
        with self._engine.begin() as connection:
            for statement, rows in ((_ADD, added), (_RAISE, raised)):
                if rows:
                    connection.execute(statement, rows)

    def exposition(self) -> bytes:
        """The text format 0.0.4."""
        registry = CollectorRegistry(auto_describe=False)
        registry.register(self)
        return generate_latest(registry)

    def collect(self) -> Iterable[Metric]:
        """See prometheus_client."""
        with self._session() as session:
            counted = session.execute(select(CounterRow.name, CounterRow.label, CounterRow.value)).all()
            status = type_coerce(JobRow.status, String)  # a later version may have other words
            statuses = select(status, func.count()).group_by(status)
            by_status: dict[str, int] = {row[0]: row[1] for row in session.execute(statuses)}
            oldest = session.scalar(
                select(func.min(JobRow.created_ms)).where(JobRow.status == Status.ACCEPTED)
            )
            alive = session.scalar(
                select(func.count())
                .select_from(WorkerRow)
                .where(WorkerRow.heartbeat_ms >= self._clock_ms() - DEAD_AFTER_MS)
            )
        for name, (label, words) in COUNTERS.items():
            family = CounterMetricFamily(name, words, labels=[label])
            for each in sorted((row for row in counted if row.name == name), key=lambda row: row.label):
                family.add_metric([each.label], each.value)
            yield family
        peaks = GaugeMetricFamily(
            PEAK, "most resident memory that a job's process took, MiB", labels=["type"]
        )
        for each in sorted((row for row in counted if row.name == PEAK), key=lambda row: row.label):
            peaks.add_metric([each.label], each.value)
        yield peaks
        jobs = GaugeMetricFamily("cusp_jobs", "jobs that are kept, by status", labels=["status"])
        for word in Status:
            jobs.add_metric([word.value], by_status.get(word.value, 0))
        yield jobs
        waited_s = 0.0 if oldest is None else max(0.0, (self._clock_ms() - oldest) / 1000)
        yield GaugeMetricFamily(
            "cusp_queue_oldest_seconds", "age of the job that waits longest; 0: none", waited_s
        )
        yield GaugeMetricFamily(
            "cusp_workers_alive", f"workers heard of within {DEAD_AFTER_MS // 1000} s", alive or 0
        )
        yield GaugeMetricFamily(
            "cusp_disk_free_bytes", "room on the data volume", shutil.disk_usage(self._data_dir).free
        )
