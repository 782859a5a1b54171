"""Store frozen records of arrays in one file (NumPy's .npz) and read them back.

The file contains no pickles, so reading an untrusted file executes no code.
"""

import dataclasses
import json
import os
import types
import typing
import zipfile
import zlib
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from pipeline.core.errors import PipelineError
from pipeline.core.mesh import Mesh

Record = TypeVar("Record")
_META = "meta"
#: Exceptions that numpy, zipfile and json raise on a damaged file.
_DAMAGE = (
    *(OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, RuntimeError, SyntaxError),
    *(zipfile.BadZipFile, zlib.error, PipelineError),
)
_SCALARS = (str, int, float, bool, type(None))


class NotAnArchive(ValueError):
    """The file is damaged, or `write` did not create it from a record of this type."""


def write(path: Path, record: Any) -> None:
    """Write `record` to `path` atomically: the file appears under its name only when it is complete.

    record : a dataclass of arrays, meshes, numbers, strings, pydantic models, bytes, and tuples, dicts and
    dataclasses of these

    Raises
    ------
    TypeError
        When a value has another type.
    """
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    meta = _encode(record, "r", arrays)
    arrays[_META] = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
    # The process id separates two workers that write the same design at the same time.
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    with temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    temporary.replace(path)


def read(path: Path, kind: type[Record]) -> Record:
    """Read the record of type `kind` that `write` stored.

    Raises
    ------
    NotAnArchive
        When the file is damaged or contains another record.
    FileNotFoundError
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            meta = json.loads(bytes(arrays[_META]))
            record: Record = _decode(kind, meta, "r", arrays)
            return record
    except FileNotFoundError:
        raise
    except _DAMAGE as error:
        raise NotAnArchive(f"{path.name}: {error}") from error


def _encode(value: Any, key: str, arrays: dict[str, np.ndarray[Any, Any]]) -> Any:
    """The JSON part of `value`; its arrays are added to `arrays` under keys that start with `key`."""
    if isinstance(value, np.ndarray):
        arrays[key] = value
        return None
    if isinstance(value, bytes):
        arrays[key] = np.frombuffer(value, dtype=np.uint8)
        return None
    if isinstance(value, Mesh):
        arrays[f"{key}.vertices"], arrays[f"{key}.faces"] = value.vertices, value.faces
        return None
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
        return {name: _encode(getattr(value, name), f"{key}.{name}", arrays) for name in names}
    if isinstance(value, tuple):
        return [_encode(each, f"{key}.{number}", arrays) for number, each in enumerate(value)]
    if isinstance(value, dict):
        return {name: _encode(each, f"{key}/{name}", arrays) for name, each in value.items()}
    if isinstance(value, _SCALARS):
        return value
    raise TypeError(f"{key}: an archive cannot contain a {type(value).__name__}")


def _decode(kind: Any, meta: Any, key: str, arrays: Any) -> Any:
    """The value of type `kind` whose JSON part is `meta` and whose arrays are stored under `key`."""
    origin = typing.get_origin(kind)
    if origin in (types.UnionType, typing.Union):
        (kind,) = (each for each in typing.get_args(kind) if each is not type(None))
        is_none = meta is None and not any(name == key or name.startswith(f"{key}.") for name in arrays.files)
        return None if is_none else _decode(kind, meta, key, arrays)
    if origin is np.ndarray:
        return arrays[key]
    if origin is tuple:
        return tuple(
            _decode(typing.get_args(kind)[0], each, f"{key}.{number}", arrays)
            for number, each in enumerate(meta)
        )
    if origin is dict:
        return {
            name: _decode(typing.get_args(kind)[1], each, f"{key}/{name}", arrays)
            for name, each in meta.items()
        }
    if kind is bytes:
        return arrays[key].tobytes()
    if kind is Mesh:
        return Mesh(arrays[f"{key}.vertices"], arrays[f"{key}.faces"])
    if issubclass(kind, BaseModel):
        return kind.model_validate(meta)
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        names = [field.name for field in dataclasses.fields(kind)]
        make: Any = kind
        return make(**{name: _decode(hints[name], meta[name], f"{key}.{name}", arrays) for name in names})
    if not isinstance(meta, kind) and not (kind is float and isinstance(meta, int)):
        raise TypeError(f"{key}: {meta!r} is not of type {kind.__name__}")
    return kind(meta)
