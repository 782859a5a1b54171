"""The task of a job's process with the meshes in the job's folder, and the design model that it leaves."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import structlog

from pipeline import Characteristics, detect_format
from service.contract.design_options import completed, known_blob
from service.contract.errors import DigestMismatch, ServiceError, UnknownBlob
from service.contract.options import resolve_settings
from service.contract.schemas import Options
from service.execution.heartbeat import Heartbeat
from service.execution.letterhead import Letterhead
from service.jobs.models import JobRow
from service.jobs.store import JobStore
from service.storage import design_cache
from service.storage.blobs import BlobStore, Upload
from service.storage.design_cache import DesignCache
from service.storage.design_faces import DesignFaces
from service.storage.retry import retry_transient
from service.webhooks.mesh_fetch import MeshFetcher, without_query

IsWanted = Callable[[], bool]
NO_LETTERHEAD = Letterhead()
log = structlog.get_logger()


class JobTasks:
    """Of one worker process; safe to use from many threads."""

    def __init__(
        self,
        jobs: JobStore,
        blobs: BlobStore,
        designs: DesignCache,
        fetcher: MeshFetcher,
        letterhead: Letterhead = NO_LETTERHEAD,
    ) -> None:
        self._jobs, self._blobs, self._designs = jobs, blobs, designs
        self._fetcher, self._letterhead = fetcher, letterhead
        self._faces = DesignFaces(blobs.store)

    def task(self, row: JobRow, folder: Path, heart: Heartbeat, is_wanted: IsWanted) -> dict[str, Any]:
        """The task for `child.run`; the meshes are copied into the folder of the job.

        is_wanted : what is unavailable is waited for while this is true

        Raises
        ------
        MeshNotFetched, PayloadTooLarge, DigestMismatch, InvalidOptions, UnknownBlob, PipelineError
        """
        if any("url" in source and not source.get("blob") for source in row.inputs.values()):
            row = self._fetch_meshes(row, heart, is_wanted)
        options = Options.model_validate(row.options)
        task: dict[str, Any] = {
            "folder": str(folder),
            "out": str(folder / "out"),
            "type": row.type,
            "settings": resolve_settings(options).model_dump(mode="json"),
            "tolerance_mm": options.tolerance_mm,
            "scan_accuracy_mm": options.scan_accuracy_mm,
            "acceptance": options.acceptance and options.acceptance.model_dump(mode="json"),
            "reference": options.reference and options.reference.model_dump(mode="json"),
            "alignment": options.alignment and options.alignment.model_dump(mode="json"),
            "seed": options.seed,
            "report": {
                "job": row.id,
                "created": datetime.fromtimestamp(row.created_ms / 1000, UTC).isoformat(),
                "company": self._letterhead.company,
                "logo": self._letterhead.logo,
            },
        }
        for mesh, source in row.inputs.items():
            path = folder / f"{mesh}.mesh"  # not the client's file name, which is only a hint of the format
            self._fetch(source["blob"], path, is_wanted, mesh)
            unit = getattr(options.units, mesh)
            task[mesh] = {"path": str(path), "filename": source["filename"], "unit": unit}
        if row.type == "registration":
            task["design"]["part"] = options.design_part
            task["scan"]["columns"] = options.columns
            name = design_cache.name_of(
                row.tenant, row.inputs["design"]["blob"], task["design"], task["settings"], options.seed
            )
            task["design_cache"] = str(folder / f"{name}.npz")
            known = self._fetch_design(name, folder / f"{name}.npz")
            log.info(
                "design model cached" if known else "design model not cached yet",
                design=row.inputs["design"]["blob"],
            )
            task["design_known"] = known
        return task

    def keep_design(self, row: JobRow, task: dict[str, Any]) -> None:
        """Store the design model that the job computed, and the names of its faces. A cache that is full or
        unavailable fails no job.
        """
        if "design_cache" not in task or task["design_known"]:
            return
        path = Path(task["design_cache"])
        try:
            self._faces.keep(row.tenant, row.inputs["design"], task["design"]["part"], Path(task["out"]))
            self._designs.keep(path.stem, path)
        except Exception:
            log.exception("design model not cached")

    def _fetch_meshes(self, row: JobRow, heart: Heartbeat, is_wanted: IsWanted) -> JobRow:
        """The row with a blob for each mesh that was given by its address.

        Raises
        ------
        MeshNotFetched, PayloadTooLarge, DigestMismatch, InvalidOptions, PipelineError
        """
        inputs, options = dict(row.inputs), row.options
        for mesh, source in row.inputs.items():
            if "url" not in source or source.get("blob"):
                continue
            if mesh == "design" and row.batch_id is not None:
                known = self._jobs.fetched_design(row.batch_id, without_query(source["url"]))
                if known is not None and source.get("sha256") is None:
                    inputs[mesh] = known
                    options = self._with_design(row, options, known["blob"])
                    continue
            heart.note("load", 0.0, f"load: fetching {mesh}")
            upload = self._fetch_url(mesh, source, is_wanted)
            filename = source.get("filename") or without_query(source["url"]).rpartition("/")[2][-255:]
            try:
                kind = detect_format(upload.head, upload.size, filename, mesh=mesh)
                self._blobs.keep(upload)
            except BaseException:
                self._blobs.discard(upload)
                raise
            self._jobs.add_blob(upload.blob_id, upload.size, kind.value, row.tenant)
            # The query is dropped: it may hold a signature
            url = without_query(source["url"])
            inputs[mesh] = {"blob": upload.blob_id, "filename": filename, "url": url}
            if mesh == "design" and known_blob(source) is None:
                options = self._with_design(row, options, upload.blob_id)
        retry_transient(
            lambda: self._jobs.note_inputs(row.id, row.attempt, inputs, options), is_wanted=is_wanted
        )
        row.inputs, row.options = inputs, options
        return row

    def _with_design(self, row: JobRow, options: dict[str, Any], design: str) -> dict[str, Any]:
        """The options completed by what is kept with the design."""
        kept = self._jobs.characteristics(design, row.tenant)
        document = None if kept is None else Characteristics.model_validate(kept.document)
        return completed(Options.model_validate(options), document).model_dump(mode="json")

    def _fetch_url(self, mesh: str, source: dict[str, Any], is_wanted: IsWanted) -> Upload:
        writer = self._blobs.writer()
        try:
            self._fetcher.fetch(source["url"], writer, is_wanted)
            upload = writer.finish()
        except ServiceError as error:
            writer.abort()
            error.detail = f"{mesh}: {error.detail}"
            raise
        except BaseException:
            writer.abort()
            raise
        if source.get("sha256") not in (None, upload.sha256):
            self._blobs.discard(upload)
            raise DigestMismatch(
                f"{mesh}: {without_query(source['url'])[:300]} has the digest {upload.sha256}, not "
                f"{source['sha256']}"
            )
        return upload

    def _fetch(self, blob_id: str, path: Path, is_wanted: IsWanted, mesh: str) -> None:
        try:
            retry_transient(lambda: self._blobs.fetch(blob_id, path), is_wanted=is_wanted)
        except FileNotFoundError as error:
            raise UnknownBlob(f"{mesh}: the blob {blob_id} is no longer stored; send it again") from error

    def _fetch_design(self, name: str, path: Path) -> bool:
        """True if the design model was cached. If the cache is unavailable, the design is analysed again."""
        try:
            return self._designs.fetch(name, path)
        except Exception:
            log.exception("cached design model not fetched")
            path.unlink(missing_ok=True)  # it may be incomplete
            return False
