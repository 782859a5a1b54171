"""Is one segment one tooth? `make bench` prints a table; needs the four labelled arches of CUSP_DATA.

A vertex of the cleaned mesh has the label (0 gum, else tooth) of the largest area of triangles around it. The
adjusted Rand index compares segments with teeth over the tooth vertices only: gum is left out of the index,
whatever segment it is in. A tooth has a centre of its own when the centre of at least one segment lies on it.
"""

import csv
import tempfile
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table
from scipy.spatial import cKDTree
from sklearn.metrics import adjusted_rand_score

import pipeline
from pipeline import Settings
from pipeline.core.mesh import IndexArray
from pipeline.core.settings import LoadSettings, SegmentationSettings
from pipeline.stages.load import load
from tests.accuracy.bench import read
from tests.conftest import data_folder

ARCHES = ("arch_001C", "arch_012C", "arch_013C", "arch_022C")
OTHERS = ("kmeans", "fuzzy_cmeans", "kmedians", "kcenters", "gaussian_mixture")
N_TEETH = 14
PROMINENCES = (3.5, 4.0, 4.33, 4.7, 5.2)  # around the default, for leave-one-arch-out


@dataclass(frozen=True, slots=True)
class Score:
    """index : adjusted Rand index over tooth vertices; own : teeth with a centre; teeth : of the arch"""

    index: float
    own: int
    teeth: int
    segments: int
    seconds: float


def tooth_of_vertex(path: Path) -> IndexArray:
    """(n,) label of each vertex of the *cleaned* mesh of the arch, from the labels of the file's
    triangles.
    """
    file = load(pipeline.MeshFile(path), "mesh", LoadSettings(), needs_surface=True).mesh
    label_of_face = np.loadtxt(path.with_suffix(".teeth.txt"), dtype=np.int64)
    cleaned = read(path)
    # Cleaning merges and drops vertices but moves none; a dropped one gives its area to the nearest.
    _, clean_of_file = cKDTree(cleaned.vertices).query(file.vertices)
    area = np.zeros((len(cleaned.vertices), label_of_face.max() + 1))
    for corner in range(3):
        np.add.at(area, (clean_of_file[file.faces[:, corner]], label_of_face), file.face_areas_mm2())
    return area.argmax(axis=1)


def score(path: Path, tooth: IndexArray, settings: Settings) -> Score:
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        found = pipeline.find_segments(path, settings=settings, out=folder)
        seconds = time.perf_counter() - start
        with (Path(folder) / "mesh.vertices.csv").open() as table:
            segment = np.array([int(row["segment"]) for row in csv.DictReader(table)])
    centres = [centre.vertex for centre in found.segments.mesh.centres]
    teeth = np.unique(tooth[tooth > 0])
    own = np.intersect1d(tooth[centres], teeth)
    index = adjusted_rand_score(tooth[tooth > 0], segment[tooth > 0])
    return Score(float(index), len(own), len(teeth), len(centres), seconds)


def candidates() -> dict[str, Settings]:
    """The presets, the default with as many centres as teeth, and the clusterings of the paper's figure 1."""
    found = {"default": Settings()}
    try:
        dental = Settings.preset("dental")
    except (ValueError, ValidationError):
        dental = Settings()
    if dental != Settings():  # an older version answers the default to any name
        found["preset dental"] = dental
    found["paper"] = Settings.paper()
    for method in ("cfsfdp", *OTHERS):
        section = SegmentationSettings.model_validate({"method": method, "n_centres": N_TEETH})
        found[f"{method}, {N_TEETH} centres"] = Settings(segmentation=section)
    return found


def leave_one_out(console: Console, truths: dict[Path, IndexArray]) -> None:
    """The threshold that decides the number of centres, chosen on three arches and scored on the fourth."""
    table = Table(
        *("arch", *(f"{value:g}" for value in PROMINENCES), "best on the others", "index", "own centre"),
        title="Leave one arch out: min_prominence chosen by the mean index of the other three",
    )
    tries = {
        path: [
            score(path, tooth, Settings(segmentation=SegmentationSettings(min_prominence=value)))
            for value in PROMINENCES
        ]
        for path, tooth in truths.items()
    }
    held_out = []
    for path, scores in tries.items():
        others = np.mean([[each.index for each in tries[other]] for other in truths if other != path], axis=0)
        best = int(others.argmax())
        held_out.append(scores[best])
        table.add_row(
            *(path.stem, *(f"{each.index:.2f}  {each.own}/{each.teeth}" for each in scores)),
            *(
                f"{PROMINENCES[best]:g}",
                f"{scores[best].index:.3f}",
                f"{scores[best].own}/{scores[best].teeth}",
            ),
        )
    console.print(table)
    own, teeth = sum(each.own for each in held_out), sum(each.teeth for each in held_out)
    console.print(
        f"held out: mean index {np.mean([each.index for each in held_out]):.3f}, own centres {own}/{teeth}"
    )


def main() -> None:
    console, data = Console(width=170), data_folder()
    if data is None:
        console.print("teeth: set CUSP_DATA to the folder of real meshes")
        return
    pipeline.preload()
    warnings.simplefilter("ignore")  # scikit-learn's about k-means that stopped at its limit
    paths = [data / "dental" / f"{arch}.ply" for arch in ARCHES]
    truths = {path: tooth_of_vertex(path) for path in paths}
    table = Table(
        *(
            "settings",
            *(path.stem for path in paths),
            "mean index",
            "own centre",
            "segments",
            "seconds an arch",
        ),
        title="Teeth: adjusted Rand index over tooth vertices, teeth with a centre of their own / teeth. "
        "Must reach: mean >= 0.80, own centres >= 90 %",
    )
    for name, settings in candidates().items():
        scores = [score(path, truths[path], settings) for path in paths]
        own, teeth = sum(each.own for each in scores), sum(each.teeth for each in scores)
        index = float(np.mean([each.index for each in scores]))
        table.add_row(
            *(name, *(f"{each.index:.2f}  {each.own}/{each.teeth}" for each in scores), f"{index:.3f}"),
            *(f"{own}/{teeth} = {own / teeth:.0%}", " ".join(str(each.segments) for each in scores)),
            f"{np.median([each.seconds for each in scores]):.1f}",
        )
        arches = ", ".join(f"{each.index:.3f} {each.own}/{each.teeth}" for each in scores)
        console.print(
            f"{name}: index {index:.3f}, own centres {own}/{teeth} ({arches}), {scores[0].seconds:.1f} s"
        )
    console.print(table)
    leave_one_out(console, truths)


if __name__ == "__main__":
    main()
