"""Scans that say where their scanner stood: two stations beside a blob, as a PTX."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline import MeshFile, RegistrationResult, Settings
from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from tests.support import shapes
from tests.support.registering import register
from tests.support.scanners.rays import first_hits
from tests.support.scans import save
from tests.support.settings import FAST

PART = shapes.bumpy_blob(4)
T_SCAN_DESIGN = shapes.motion(11)
MEASURED = PART.moved(T_SCAN_DESIGN)
CENTRE = MEASURED.vertices.mean(axis=0)
#: Places of the scanner, frame of the scan, mm, and how it was turned there.
STATIONS = CENTRE + np.array([[150.0, 20.0, 60.0], [-90.0, -140.0, 10.0]])
TURNS = Rotation.random(2, random_state=4).as_matrix()
N_COLUMNS, N_ROWS = 80, 60
TOLERANCE_MM, TOLERANCE_DEG = 0.1, 0.3


def seen_by(station: FloatArray) -> FloatArray:
    """(N_COLUMNS * N_ROWS, 3) first hits on a grid of directions about the part, NaN of a miss."""
    ahead = (CENTRE - station) / np.linalg.norm(CENTRE - station)
    side = np.cross(ahead, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    half = 1.1 * MEASURED.diagonal_mm / 2 / np.linalg.norm(CENTRE - station)
    u, v = np.meshgrid(np.linspace(-half, half, N_COLUMNS), np.linspace(-half, half, N_ROWS), indexing="ij")
    directions = ahead + u.reshape(-1, 1) * side + v.reshape(-1, 1) * np.cross(side, ahead)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distance_mm, _ = first_hits(MEASURED, np.broadcast_to(station, directions.shape), directions)
    points: FloatArray = (
        station + np.where(np.isfinite(distance_mm), distance_mm, np.nan)[:, None] * directions
    )
    return points


SEEN = [seen_by(station) for station in STATIONS]


def ptx(points: FloatArray, station: FloatArray, turn: FloatArray) -> str:
    """One scan: its points in the frame of the scanner, 0 0 0 of a miss. turn : (3, 3), scanner to file"""
    local = np.nan_to_num((points - station) @ turn)
    head = [str(N_COLUMNS), str(len(points) // N_COLUMNS), numbers(station), *map(numbers, turn.T)]
    transform = [numbers(row) + " 0" for row in turn.T] + [numbers(station) + " 1"]
    return "\n".join([*head, *transform, *(numbers(row) + " 0.5" for row in local)]) + "\n"


def numbers(row: FloatArray) -> str:
    return " ".join(f"{value:.6f}" for value in row)


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(PART, tmp_path_factory.mktemp("design") / "design.ply")


def registered(design: Path, text: str, folder: Path) -> RegistrationResult:
    (folder / "scan.ptx").write_text(text)
    return register(design, MeshFile(folder / "scan.ptx", "mm"), settings=Settings.model_validate(FAST))


def error(result: RegistrationResult) -> tuple[float, float]:
    """Of the pose: degrees, and mm at the centre of the design."""
    assert result.transform is not None
    T = np.array(result.transform.matrix) @ T_SCAN_DESIGN
    centre = PART.vertices.mean(axis=0)
    return rigid.angle_deg(T), float(np.linalg.norm(rigid.transformed(T, centre[None])[0] - centre))


def test_two_stations_are_one_scan_that_each_of_them_could_see(design: Path, tmp_path: Path) -> None:
    text = "".join(ptx(*each) for each in zip(SEEN, STATIONS, TURNS, strict=True))
    result = registered(design, text, tmp_path)
    assert "stations_ignored" not in [note.code for note in result.warnings]
    angle_deg, offset_mm = error(result)
    assert angle_deg < TOLERANCE_DEG and offset_mm < TOLERANCE_MM


def test_merged_scans_that_claim_one_station_are_placed_without_it(design: Path, tmp_path: Path) -> None:
    merged = np.concatenate(SEEN)
    result = registered(design, ptx(merged, STATIONS[0], TURNS[0]), tmp_path)
    (note,) = [note for note in result.warnings if note.code == "stations_ignored"]
    assert "25 % of the points" in note.detail
    angle_deg, offset_mm = error(result)
    assert angle_deg < TOLERANCE_DEG and offset_mm < TOLERANCE_MM
