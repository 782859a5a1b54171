"""Stored bytes: uploaded meshes by their content, and result files by job and attempt.

obstore reads and writes a folder or an S3 bucket, depending on the URL. An upload is written once under a
temporary name while it is hashed; then it is renamed to the hash of its content.
"""

import hashlib
import mimetypes
import os
import re
import uuid
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import IO, TYPE_CHECKING

import obstore
from obstore.store import LocalStore, ObjectStore, S3Store

from pipeline import HEAD_BYTES
from service.storage.durable import settle
from service.storage.regular_file import open_regular_file

if TYPE_CHECKING:
    from obstore import ObjectMeta  # exists for type checkers only

CHUNK_BYTES = 1024 * 1024
FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}")  # of a result file
MAX_FILES = 200  # of one job; the largest has some 40
MEDIA_TYPES = {
    ".ply": "application/x-ply",
    ".csv": "text/csv",
    ".glb": "model/gltf-binary",
    ".3mf": "model/3mf",
}


@dataclass(frozen=True, slots=True)
class Upload:
    """An upload that is written but not yet stored under its content."""

    key: str
    sha256: str
    size: int
    head: bytes  # the first HEAD_BYTES, for `pipeline.detect_format`

    @property
    def blob_id(self) -> str:
        """`sha256:<hex>`."""
        return f"sha256:{self.sha256}"


class UploadWriter:
    """Writes an upload chunk by chunk; call `finish` or `abort` at the end."""

    def __init__(self, store: ObjectStore) -> None:
        self._store = store
        self._key = f"incoming/{uuid.uuid4()}"
        # A bucket needs parts of at least 5 MiB. For a file, a small buffer saves memory of the API.
        buffer_bytes = CHUNK_BYTES if isinstance(store, LocalStore) else 8 * CHUNK_BYTES
        self._writer = obstore.open_writer(store, self._key, buffer_size=buffer_bytes)
        self._hash = hashlib.sha256()
        self._size = 0
        self._head = b""

    def write(self, chunk: bytes) -> None:
        """Append."""
        if len(self._head) < HEAD_BYTES:
            self._head += chunk[: HEAD_BYTES - len(self._head)]
        self._size += len(chunk)
        self._hash.update(chunk)
        self._writer.write(chunk)

    def finish(self) -> Upload:
        """Flush to disk."""
        self._writer.close()
        return Upload(self._key, self._hash.hexdigest(), self._size, self._head)

    def abort(self) -> None:
        """Delete what was written. If that fails, retention deletes it a day later."""
        with suppress(Exception):  # most likely a full disk
            self._writer.close()
        with suppress(Exception):
            obstore.delete(self._store, self._key)


def open_store(url: str) -> ObjectStore:
    """A folder (`file:///path`, created if missing) or an existing bucket (`s3://bucket/prefix`).

    Credentials, region and endpoint of S3 are read from the usual `AWS_*` variables.
    """
    if url.startswith("file://"):
        return LocalStore(url.removeprefix("file://"), mkdir=True)
    bucket, _, prefix = url.removeprefix("s3://").partition("/")
    endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or ""
    plain = endpoint.startswith("http://")  # an explicit http:// endpoint is intended
    return S3Store(bucket, prefix=prefix or None, client_options={"allow_http": plain})


class BlobStore:
    """The stored bytes of one service. Safe to share between threads."""

    def __init__(self, url: str) -> None:
        self._store = open_store(url)
        self._folder = Path(url.removeprefix("file://")) if url.startswith("file://") else None

    @property
    def store(self) -> ObjectStore:
        """The underlying store, for the design cache."""
        return self._store

    def writer(self) -> UploadWriter:
        """Start an upload."""
        return UploadWriter(self._store)

    def receive(self, file: IO[bytes]) -> Upload:
        """Write an open file as an upload."""
        writer = self.writer()
        try:
            while chunk := file.read(CHUNK_BYTES // 4):
                writer.write(chunk)
            return writer.finish()
        except BaseException:
            writer.abort()
            raise

    def keep(self, upload: Upload) -> None:
        """Store the upload under its content. The same content is stored once."""
        self._settle([upload.key])
        key = _blob_key(upload.blob_id)
        obstore.rename(self._store, upload.key, key)
        self._settle(_folders_of(key))

    def discard(self, upload: Upload) -> None:
        """Delete a refused upload."""
        obstore.delete(self._store, upload.key)

    def has(self, blob_id: str) -> bool:
        """True if the content is stored."""
        try:
            obstore.head(self._store, _blob_key(blob_id))
        except FileNotFoundError:
            return False
        return True

    def remove(self, blob_id: str, *, older_than_ms: int) -> None:
        """Delete the content, unless it was sent again since `older_than_ms`."""
        key = _blob_key(blob_id)
        with suppress(FileNotFoundError):
            if _ms(obstore.head(self._store, key)) < older_than_ms:
                obstore.delete(self._store, key)

    def fetch(self, blob_id: str, path: Path) -> None:
        """Write the blob's content to `path`. Raises FileNotFoundError if it is not stored."""
        content = obstore.get(self._store, _blob_key(blob_id)).stream(min_chunk_size=CHUNK_BYTES)
        with path.open("wb") as file:
            for chunk in content:
                file.write(memoryview(chunk))

    def publish(self, job_id: str, attempt: int, folder: Path) -> list[dict[str, str | int]]:
        """Store every file of `folder` for this attempt; clients see them once the row of the job refers to
        it.

        Returns name, size, sha256 and media_type of each, `results.json` first, then by name.
        """
        entries: list[dict[str, str | int]] = []
        paths = [path for path in islice(folder.iterdir(), MAX_FILES) if FILE_NAME.fullmatch(path.name)]
        for path in sorted(paths, key=lambda path: (path.name != "results.json", path.name)):
            if (opened := open_regular_file(path)) is None:
                continue
            with opened as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
                size = file.tell()
                file.seek(0)
                obstore.put(self._store, _file_key(job_id, attempt, path.name), file)
            media_type = MEDIA_TYPES.get(path.suffix) or mimetypes.guess_type(path.name)[0]
            entries.append(
                {
                    "name": path.name,
                    "size": size,
                    "sha256": digest,
                    "media_type": media_type or "application/octet-stream",
                }
            )
        keys = [_file_key(job_id, attempt, str(entry["name"])) for entry in entries]
        self._settle([*keys, *(_folders_of(keys[0]) if keys else [])])
        return entries

    def _settle(self, keys: list[str]) -> None:
        """Flush to disk in a folder. A bucket answers only when the data is stored."""
        if self._folder is not None:
            settle(self._folder / key for key in keys)

    def read(self, job_id: str, attempt: int, name: str) -> Iterator[bytes]:
        """The content of a published file. Raises FileNotFoundError here, not at the first chunk, if it is
        not stored.
        """
        content = obstore.get(self._store, _file_key(job_id, attempt, name))
        return (bytes(chunk) for chunk in content.stream(min_chunk_size=CHUNK_BYTES))

    def remove_results(self, job_id: str, attempt: int | None = None) -> None:
        """Delete the files of one attempt of the job, or of all."""
        prefix = f"results/{job_id}" if attempt is None else f"results/{job_id}/{attempt}"
        for batch in obstore.list(self._store, prefix=prefix):
            obstore.delete(self._store, [entry["path"] for entry in batch])

    def clear_incoming(self, *, older_than_ms: int) -> None:
        """Delete uploads that a crash interrupted: those last written before `older_than_ms`."""
        for batch in obstore.list(self._store, prefix="incoming"):
            obstore.delete(self._store, [entry["path"] for entry in batch if _ms(entry) < older_than_ms])

    def stored(self, *, older_than_ms: int) -> Iterator[list[str]]:
        """Ids of blobs last sent before `older_than_ms`, in batches."""
        for batch in obstore.list(self._store, prefix="blobs", chunk_size=1000):
            yield [
                f"sha256:{entry['path'].rpartition('/')[2]}" for entry in batch if _ms(entry) < older_than_ms
            ]

    def jobs_with_results(self) -> list[str]:
        """Ids of jobs with any stored file, published or not."""
        prefixes = obstore.list_with_delimiter(self._store, prefix="results")["common_prefixes"]
        return [path.rpartition("/")[2] for path in prefixes]


def _ms(entry: "ObjectMeta") -> float:
    return entry["last_modified"].timestamp() * 1000


def _folders_of(key: str) -> list[str]:
    """The parent folders of a key, up to the root of the store."""
    return [str(folder) for folder in Path(key).parents]


def _blob_key(blob_id: str) -> str:
    digest = blob_id.removeprefix("sha256:")
    return f"blobs/{digest[:2]}/{digest}"


def _file_key(job_id: str, attempt: int, name: str) -> str:
    return f"results/{job_id}/{attempt}/{name}"
