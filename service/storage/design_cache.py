"""Analyses of designs, kept for their next scans: a design is sent once and its analysis computed once.

The file is made and read by jobs' children; here it is bytes under the name of all that it follows from. The child looks
once more whether it is the right one, so a wrong name costs time and changes no result.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import obstore
from obstore.store import ObjectStore

import pipeline
from service.storage.blobs import CHUNK_BYTES

PREFIX = "designs"
MIB = 1024 * 1024


class DesignCache:
    """At most about `limit_mib`, the oldest deleted first; 0 keeps nothing. Safe to share between threads."""

    def __init__(self, store: ObjectStore, limit_mib: int) -> None:
        self._store, self._limit = store, limit_mib * MIB

    def fetch(self, name: str, path: Path) -> bool:
        """Write what is kept under `name` to `path`; False when there is nothing."""
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
        """Store the file under `name` for the next scan."""
        if 0 < path.stat().st_size <= self._limit:
            obstore.put(self._store, f"{PREFIX}/{name}", path)
            self._make_room()

    def remove_older(self, before_ms: float) -> int:
        """Delete what was made before then. Returns how many."""
        entries = [entry for batch in obstore.list(self._store, prefix=PREFIX) for entry in batch]
        old = [entry["path"] for entry in entries if entry["last_modified"].timestamp() * 1000 < before_ms]
        obstore.delete(self._store, old)
        return len(old)

    def _make_room(self) -> None:
        entries = [entry for batch in obstore.list(self._store, prefix=PREFIX) for entry in batch]
        too_much = sum(entry["size"] for entry in entries) - self._limit
        for entry in sorted(entries, key=lambda entry: (entry["last_modified"], entry["path"])):
            if too_much <= 0:
                return
            obstore.delete(self._store, entry["path"])
            too_much -= entry["size"]


def name_of(tenant: str, blob_id: str, design: dict[str, Any], settings: dict[str, Any], seed: int) -> str:
    """All that the analysis follows from, as one word; and the tenant, so that none reads what another's job wrote.

    design : `unit` and `filename` of the task
    """
    ending = Path(design["filename"] or "").suffix.lower()
    made_of = [tenant, blob_id, ending, design["unit"], settings, seed, pipeline.code_fingerprint()]
    return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()
