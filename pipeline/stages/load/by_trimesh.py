"""Formats that trimesh reads."""

import io
import warnings

import numpy as np
import trimesh

from pipeline.core.errors import IndexOutOfRange, TruncatedFile, UnreadableFile
from pipeline.core.formats import Format
from pipeline.stages.load.contents import Body, Contents


def read_by_trimesh(data: bytes, kind: Format) -> Contents:
    """The bodies of a file, and the unit of a 3MF. Exceptions of the readers become a PipelineError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(io.BytesIO(data), file_type=kind.value, process=False)
            parts = scene.dump(concatenate=False)
    except MemoryError:
        raise
    except Exception as error:
        # The readers of trimesh raise many types of exception (KeyError, struct.error, those of lxml, ...).
        text = str(error).lower()
        if isinstance(error, IndexError) or "index outside the range" in text:
            raise IndexOutOfRange(f"a face of the {kind} refers to a vertex that does not exist") from error
        if "length" in text or "unexpected end" in text or "truncated" in text:
            raise TruncatedFile(f"the {kind} ends before what its header announces") from error
        raise UnreadableFile(
            f"the {kind} could not be parsed: the file is damaged or has another format"
        ) from error
    bodies = []
    for part in parts:
        if isinstance(part, trimesh.Trimesh | trimesh.PointCloud):
            points = np.asarray(part.vertices, dtype=np.float64).reshape(-1, 3)
            faces = np.asarray(getattr(part, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
            bodies.append(Body(points, faces))
    return Contents(tuple(bodies), scene.units if kind is Format.THREE_MF else None)
