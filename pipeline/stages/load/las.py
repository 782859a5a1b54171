"""LAS and LAZ 1.0 to 1.4: the points of a laser scan, in the unit of its coordinate system.

Source: ASPRS LAS specification 1.4-R15; LAZ is read by `laspy` and `lazrs`. Colours, intensity, times and
waveforms are not used.
"""

import io
import struct
from typing import Any

import numpy as np

from pipeline.core.errors import MeshTooLarge, PipelineError, TruncatedFile, UnreadableFile
from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.extras import require
from pipeline.stages.load.las_chunks import check_chunks
from pipeline.stages.load.las_unit import unit_of_las

#: Points that are decoded at once, to bound memory.
CHUNK = 500_000
#: Classification of noise (table 9 and 17 of the specification); 18 means that in point formats 6 to 10 only.
LOW_NOISE, HIGH_NOISE = 7, 18
FIRST_EXTENDED_FORMAT = 6
#: Bytes of the fixed header of LAS 1.0; and where the version and the numbers of records are.
HEADER_BYTES = 227
MINOR_VERSION_AT, N_RECORDS_AT, EXTENDED_AT = 25, 100, 235
#: Bytes of the header of a variable length record, and of an extended one.
RECORD_BYTES, EXTENDED_RECORD_BYTES = 54, 60


def read_las(data: bytes, settings: LoadSettings) -> Contents:
    """One body with all points but noise and withheld ones.

    Notes: `points_left_out`, `unit_assumed`.

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge
    """
    require("las", "a LAS")
    import laspy

    if len(data) < HEADER_BYTES:
        raise TruncatedFile(f"the LAS has {len(data)} bytes; its header alone has {HEADER_BYTES}")
    _check_records(data)
    try:
        with laspy.open(io.BytesIO(data), laz_backend=laspy.LazBackend.Lazrs) as reader:
            _check_header(reader.header, len(data), settings)
            if reader.header.are_points_compressed:
                check_chunks(data, reader.header)
            points, noise, withheld = _points(reader)
            unit, notes = unit_of_las([*reader.header.vlrs, *(reader.header.evlrs or [])])
    except (PipelineError, MemoryError):
        raise
    except Exception as error:  # of any type: what laspy meets in a damaged header, and the LAZ decoder
        if "fill whole buffer" in str(error):
            raise TruncatedFile("the compressed points of the LAZ end early") from error
        raise _damaged(error) from error
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # of the LAZ decoder, and no Exception
            raise
        raise _damaged(error) from error
    kept = points[~(noise | withheld)]
    if not len(kept):
        raise UnreadableFile(f"the LAS has no points that are neither noise nor withheld, of {len(points)}")
    return Contents((Body.cloud(kept),), unit, (*_left_out(noise, withheld), *notes))


def _damaged(error: BaseException) -> UnreadableFile:
    return UnreadableFile(f"the LAS is damaged: {str(error)[:200] or type(error).__name__}")


def _check_records(data: bytes) -> None:
    """The numbers of variable length records must fit in the file: `laspy` would read four billion."""
    (n_records,) = struct.unpack_from("<I", data, N_RECORDS_AT)
    start, n_extended = 0, 0
    if data[MINOR_VERSION_AT] >= 4 and len(data) >= EXTENDED_AT + 12:
        start, n_extended = struct.unpack_from("<QI", data, EXTENDED_AT)
    room = max(len(data) - HEADER_BYTES, 0)
    extended_room = max(len(data) - start, 0)
    if n_records * RECORD_BYTES > room or n_extended * EXTENDED_RECORD_BYTES > extended_room:
        raise TruncatedFile(
            f"the LAS announces {n_records} variable length records and {n_extended} extended ones, "
            f"more than its {len(data)} bytes hold"
        )


def _check_header(header: Any, size: int, settings: LoadSettings) -> None:
    """Counts, record length and scales, before any point is decoded."""
    count = int(header.point_count)
    if count == 0:
        raise UnreadableFile("the header of the LAS announces no points")
    if count > settings.max_points:
        raise MeshTooLarge(f"the LAS has {count} points; the limit is {settings.max_points}")
    room = size - int(header.offset_to_point_data)
    if not header.are_points_compressed and count * header.point_format.size > room:
        raise TruncatedFile(
            f"the LAS announces {count} points of {header.point_format.size} bytes, and has "
            f"{max(room, 0) // header.point_format.size}"
        )
    scales, offsets = np.array(header.scales), np.array(header.offsets)
    if not (np.isfinite(scales).all() and np.isfinite(offsets).all() and (scales != 0).all()):
        raise UnreadableFile(
            f"the LAS has scale factors {scales.tolist()} and offsets {offsets.tolist()}, "
            "which give no coordinates"
        )


def _points(reader: Any) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Coordinates (n, 3), and which points are noise and withheld."""
    header = reader.header
    scales, offsets = np.array(header.scales), np.array(header.offsets)
    noise_classes = (
        [LOW_NOISE, HIGH_NOISE] if header.point_format.id >= FIRST_EXTENDED_FORMAT else [LOW_NOISE]
    )
    points, noise, withheld = [], [], []
    for chunk in reader.chunk_iterator(CHUNK):
        counts = np.stack([np.asarray(chunk[axis], dtype=np.float64) for axis in "XYZ"], axis=1)
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as not finite
            points.append(counts * scales + offsets)
        noise.append(np.isin(np.asarray(chunk["classification"]), noise_classes))
        withheld.append(np.asarray(chunk["withheld"]).astype(bool))
    if sum(map(len, points)) != header.point_count:
        raise TruncatedFile(f"the LAS announces {header.point_count} points, and has {sum(map(len, points))}")
    return np.concatenate(points), np.concatenate(noise), np.concatenate(withheld)


def _left_out(noise: BoolArray, withheld: BoolArray) -> list[Note]:
    n_noise, n_withheld = int(noise.sum()), int((withheld & ~noise).sum())
    parts = [f"{n_noise} classified as noise"] * (n_noise > 0) + [f"{n_withheld} withheld"] * (n_withheld > 0)
    if not parts:
        return []
    detail = (
        f"the LAS: {' and '.join(parts)} of {len(noise)} points were left out, as the file asks; "
        "nothing else depends on them"
    )
    return [Note(code="points_left_out", detail=detail)]
