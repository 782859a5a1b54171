"""The faces of the CAD models of designs that were analysed: so that a request that names another face is
refused before its job is queued. A note that is lost costs nothing but that.
"""

import csv
import hashlib
import io
import json
from pathlib import Path
from typing import Any

import obstore
from obstore.store import ObjectStore

import pipeline
from service.storage.design_cache import PREFIX
from service.storage.regular_file import open_regular_file

#: The table of faces that a job writes, and the largest that is read: it is a file of the child process.
TABLE, MAX_TABLE_BYTES = "design.brep_faces.csv", 4 * 1024 * 1024


class DesignFaces:
    """Names of the faces of designs, in the order of their numbers. They go with the cached design models."""

    def __init__(self, store: ObjectStore) -> None:
        self._store = store

    def keep(self, tenant: str, design: dict[str, Any], part: str | None, out: Path) -> None:
        """Note the faces of a design from the files of a job, where it has any. design : input of the job"""
        if (opened := open_regular_file(out / TABLE)) is None:
            return
        with opened as file:
            table = file.read(MAX_TABLE_BYTES + 1)
        if len(table) > MAX_TABLE_BYTES:
            return
        names = [row.get("name") or "" for row in csv.DictReader(io.StringIO(table.decode(), newline=""))]
        obstore.put(self._store, _key(tenant, design, part), json.dumps(names).encode())

    def names(self, tenant: str, design: dict[str, Any], part: str | None) -> list[str] | None:
        """Of each face, often empty; None where they are not known."""
        try:
            content = bytes(obstore.get(self._store, _key(tenant, design, part)).bytes())
        except FileNotFoundError:
            return None
        names: list[str] = json.loads(content)
        return names


def _key(tenant: str, design: dict[str, Any], part: str | None) -> str:
    ending = Path(design.get("filename") or "").suffix.lower()
    inputs = [tenant, design.get("blob"), ending, part, pipeline.code_fingerprint()]
    return f"{PREFIX}/{hashlib.sha256(json.dumps(inputs).encode()).hexdigest()}.faces.json"
