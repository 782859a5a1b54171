"""The cache of design models: a design is analysed once for many scans.

The processes of jobs write and read the files; here they are bytes under a key of all that they depend on. A
job also verifies the file that it gets, so a wrong key costs time but changes no result.
"""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import obstore
from obstore.store import ObjectStore

import pipeline
from service.storage.blobs import CHUNK_BYTES
from service.storage.regular_file import open_regular_file

PREFIX = "designs"
MIB = 1024 * 1024


class DesignCache:
    """Holds about `limit_mib`; the oldest are deleted first; 0 disables it. Safe to share between threads."""

    def __init__(self, store: ObjectStore, limit_mib: int) -> None:
        self._store, self._limit = store, limit_mib * MIB

    def fetch(self, name: str, path: Path) -> bool:
        """Write the cached file `name` to `path`; False if there is none."""
        if not self._limit:
            return False
        try:
            content = obstore.get(self._store, f"{PREFIX}/{name}").stream(min_chunk_size=CHUNK_BYTES)
        except FileNotFoundError:
            return False
        with path.open("wb") as file:
            for chunk in content:
                file.write(memoryview(chunk))
        return True

    def keep(self, name: str, path: Path) -> None:
        """Store the file, which a job left, under `name`; nothing if it is no regular one."""
        if (opened := open_regular_file(path)) is None:
            return
        with opened as file:
            if 0 < os.fstat(file.fileno()).st_size <= self._limit:
                obstore.put(self._store, f"{PREFIX}/{name}", file)
                self._make_room()

    def remove_older(self, before_ms: float) -> int:
        """Delete files older than `before_ms`. Returns how many."""
        entries = [entry for batch in obstore.list(self._store, prefix=PREFIX) for entry in batch]
        old = [entry["path"] for entry in entries if entry["last_modified"].timestamp() * 1000 < before_ms]
        obstore.delete(self._store, old)
        return len(old)

    def _make_room(self) -> None:
        entries = [entry for batch in obstore.list(self._store, prefix=PREFIX) for entry in batch]
        excess = sum(entry["size"] for entry in entries) - self._limit
        for entry in sorted(entries, key=lambda entry: (entry["last_modified"], entry["path"])):
            if excess <= 0:
                return
            obstore.delete(self._store, entry["path"])
            excess -= entry["size"]


def name_of(tenant: str, blob_id: str, design: dict[str, Any], settings: dict[str, Any], seed: int) -> str:
    """The key of a design model: a hash of all inputs of the analysis, and of the tenant, since tenants share
    no files.

    design : `unit`, `filename` and `part` of the task
    """
    ending = Path(design["filename"] or "").suffix.lower()
    part = design.get("part")
    inputs = [tenant, blob_id, ending, design["unit"], part, settings, seed, pipeline.code_fingerprint()]
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()
