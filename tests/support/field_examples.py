"""An example for every field of the OpenAPI document, taken from the example documents: written to
service/field_examples.json, from where the document has them.

    .venv/bin/python -m tests.support.field_examples
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pipeline import Format
from service.api.app import create_app
from service.api.examples import BLOB_ID, INSTANCE, JOB_ID, examples
from service.api.openapi_files import as_text
from service.settings import ServiceSettings
from service.version import VERSION

FOUND = Path(__file__).parents[2] / "service" / "api" / "field_examples.json"
RESULTS = Path(__file__).parents[2] / "openapi" / "examples"
AT = "2026-09-22T09:33:20Z"
#: Answers that have no example file.
OTHERS: dict[str, list[Any]] = {
    "JobPage": [{"jobs": [], "next": JOB_ID}],
    "Limits": [
        {
            "max_upload_mib": 512,
            "job_time_limit_s": 900.0,
            "job_memory_limit_mib": 4096,
            "job_disk_limit_mib": 4096,
            "queue_limit": 20000,
            "tenant_queue_limit": 15000,
            "tenant_quota_mib": 10240,
            "tenant_stored_mib": 1843.217,
            "rate_limit_per_s": 1000,
            "parallel_jobs": 2,
            "job_types": ["registration", "landmarks", "study"],
            "formats": [each.value for each in Format],
            "setting_ceilings": {"load.max_faces": 5000000.0, "load.max_archive_expansion": 200.0},
        }
    ],
    "Version": [{"name": "cusp", "version": VERSION, "schema_version": "1"}],
    "SandboxMeasures": [
        {
            "landlock": 4,
            "system_calls_filtered": False,
            "missing": ["system calls: they are not filtered (libseccomp.so.2 is not installed)"],
        }
    ],
    "Acceptance": [
        {
            "lower_mm": -0.2,
            "upper_mm": 0.3,
            "min_within": 0.95,
            "max_deviation_mm": 0.6,
            "min_coverage": 0.8,
            "min_confidence": 0.9,
            "patch_mm": 2.0,
            "uncertainty_mm": 0.02,
        },
        {"tolerance_mm": 0.2},
    ],
    "RegionLimits": [
        {
            "name": "rim",
            "region": {"kind": "segments", "segments": [3, 4]},
            "tolerance_mm": 0.1,
            "lower_mm": -0.1,
            "upper_mm": 0.1,
            "min_within": 0.95,
            "max_deviation_mm": 0.3,
        }
    ],
    "BoxRegion": [{"kind": "box", "min_mm": [0, 0, 0], "max_mm": [10, 10, 5]}],
    "SphereRegion": [{"kind": "sphere", "centre_mm": [12, 4, 0], "radius_mm": 6}],
    "CylinderRegion": [{"kind": "cylinder", "start_mm": [0, 0, 0], "end_mm": [0, 0, 20], "radius_mm": 4}],
    "SegmentsRegion": [{"kind": "segments", "segments": [3, 4]}],
    "BrepFacesRegion": [{"kind": "brep_faces", "faces": [7, "bore"]}],
    "Centre": [{"brep_faces": [0, 4, 5]}],
    "SegmentsAtRegion": [{"kind": "segments_at", "places_mm": [[5, 7, 0]], "radius_mm": 1.0}],
    "BatchRequest": [
        {
            "design": {"blob": BLOB_ID},
            "scans": [
                {
                    "scan": {"url": "https://files.example.com/A-17.ply"},
                    "reference": {"serial": "A-17"},
                    "label": "A-17.ply",
                }
            ],
            "options": {"tolerance_mm": 0.2},
            "label": "night shift",
            "webhook": {"url": "https://mes.example.com/hooks/cusp"},
        }
    ],
    "BatchScan": [{"label": "A-17.ply", "scan": {"url": "https://files.example.com/A-17.ply"}}],
    "Batch": [
        {
            "id": JOB_ID,
            "label": "night shift",
            "status": "running",
            "total": 300,
            "by_status": {"accepted": 120, "running": 2, "successful": 177, "failed": 1},
            "by_verdict": {"ok": 170, "uncertain": 7},
            "by_decision": {"pass": 161, "fail": 9, "not_judged": 7},
            "created": AT,
            "finished": AT,
            "links": {
                "self": f"/v1/batches/{JOB_ID}",
                "jobs": f"/v1/jobs?batch_id={JOB_ID}",
                "table": f"/v1/batches/{JOB_ID}/table.csv",
                "deliveries": f"/v1/batches/{JOB_ID}/deliveries",
            },
        }
    ],
    "BatchPage": [{"batches": [], "next": JOB_ID}],
    "Job": [{"batch_id": JOB_ID}],
    "JobForecast": [
        {"elapsed_s": 12.4, "place": None, "remaining_s": 31.0, "based_on": 17},
        {"elapsed_s": 3.1, "place": 4, "remaining_s": 96.5, "based_on": 17},
    ],
    "UrlRef": [
        {
            "url": "https://files.example.com/scans/0042.ply?X-Amz-Signature=...",
            "sha256": BLOB_ID.removeprefix("sha256:"),
            "filename": "0042.ply",
        }
    ],
    "JobInput": [{"url": "https://files.example.com/scans/0042.ply"}],
    "NamedRegion": [{"kind": "named", "name": "seat"}],
    "Characteristics": [
        {
            "regions": [{"name": "seat", "region": {"kind": "segments_at", "places_mm": [[5, 7, 0]]}}],
            "tolerance_mm": 0.2,
            "acceptance": {"tolerance_mm": 0.2},
            "alignment": {"kind": "best_fit"},
        }
    ],
    "FacesRegion": [{"kind": "faces", "faces": [0, 1, 2, 3]}],
    "PointLimits": [
        {
            "name": "P1",
            "position_mm": [10, 10, 0],
            "normal": [0, 0, 1],
            "radius_mm": 2,
            "tolerance_mm": 0.1,
            "lower_mm": -0.1,
            "upper_mm": 0.1,
        }
    ],
    "DistanceLimits": [
        {
            "name": "width",
            "first": "P1",
            "second": "P2",
            "tolerance_mm": 0.1,
            "lower_mm": -0.1,
            "upper_mm": 0.1,
        }
    ],
    "Reference": [
        {
            "part_number": "BR-7",
            "serial": "A-17",
            "batch": "2026-11",
            "order": "4711",
            "machine": "SLA 2",
            "operator": "jd",
            "gauge": "scanner 3",
            "measured_at": "2026-11-27T14:16:01",
            "more": {"shift": "2"},
        }
    ],
    "Check": [{"region": "rim"}],
    "BestFit": [
        {
            "kind": "best_fit",
            "regions": [{"region": {"kind": "segments", "segments": [3]}, "weight": 2.0}],
            "other_weight": 0.1,
        }
    ],
    "ConstrainedFit": [
        {
            "kind": "constrained",
            "regions": [{"region": {"kind": "segments", "segments": [3]}, "weight": 2.0}],
            "other_weight": 0.1,
            "hold": ["tx", "ty", "rz"],
            "about_mm": [0, 0, 10],
            "line": {"point_mm": [0, 0, 0], "direction": [0, 0, 1]},
            "plane": {"normal": [0, 0, 1]},
        }
    ],
    "RpsFit": [
        {
            "kind": "rps",
            "points": [{"name": "A1", "position_mm": [5, 5, 0], "direction": [0, 0, -1], "radius_mm": 2.0}],
        }
    ],
    "ToleranceFit": [{"kind": "tolerance_fit", "tolerance_mm": 0.2, "lower_mm": -0.2, "upper_mm": 0.2}],
    "LandmarksFit": [
        {
            "kind": "landmarks",
            "pairs": [{"name": "L1", "design_mm": [0, 0, 0], "scan_mm": [12.1, 3.9, 40.2]}],
            "design_landmarks": [0, 1, 4, 7],
        }
    ],
    "AppliedAlignment": [
        {
            "kind": "rps",
            "applied": False,
            "reason": "the scan does not show 'A3'",
            "residual_mm": 0.0,
            "best_fit_residual_mm": 0.081,
            "best_fit_matrix": [[1, 0, 0, 12.0], [0, 1, 0, -7.0], [0, 0, 1, 3.0], [0, 0, 0, 1]],
            "translation_mm": 0.074,
            "angle_deg": 0.11,
            "iterations": 3,
            "free_motions": [{"kind": "translation", "axis": [1, 0, 0], "point_mm": [0, 0, 0]}],
            "points": [
                {
                    "name": "A1",
                    "position_mm": [5, 5, 0],
                    "best_fit_mm": 0.062,
                    "value_mm": 0.0,
                    "n": 41,
                }
            ],
        }
    ],
    "Health": [{"status": "ok"}],
    "Webhook": [{"url": "https://mes.example.com/hooks/cusp"}],
    "Options": [{"label": "bracket-0042", "tolerance_mm": 0.1}],
    "Problem": [{"mesh": "scan", "stage": "load", "instance": INSTANCE}],
    "FileEntry": [
        {
            "name": "aligned.ply",
            "size": 251304,
            "sha256": BLOB_ID.removeprefix("sha256:"),
            "media_type": "application/vnd.ply",
            "href": f"/v1/jobs/{JOB_ID}/files/aligned.ply",
        }
    ],
    "Delivery": [
        {
            "id": "msg_01a2019a66857220",
            "job": JOB_ID,
            "event": "job.successful",
            "url": "https://mes.example.com/hooks/cusp",
            "state": "delivered",
            "next": AT,
            "attempts": [{"at": AT, "status": 503, "error": "no answer within 15 s", "seconds": 0.21}],
        }
    ],
    "Input": [{"part": "bracket", "columns": "id,x,y,z"}],
    "Scale": [{"unit_factor": 25.4}],
    "ScaleFactor": [{"reason": "the scan shows no surfaces whose distance would tell the size along z"}],
    "Finding": [
        {"code": "loose_fit", "detail": "the truncated RMS is 0.72 % of the diagonal", "value": 0.0072}
    ],
    "Note": [{"code": "point_cloud", "detail": "scan: points without triangles; they weigh the same each"}],
    "ProblemItem": [{"pointer": "/options/tolerance", "detail": "unknown key; did you mean tolerance_mm?"}],
    "Alternative": [
        {
            "matrix": [[-1, 0, 0, 40.0], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
            "score": 1.02,
            "rmse_mm": 0.094,
            "symmetry_of_design": True,
            "equivalent_poses": 3,
        }
    ],
    "Symmetry": [
        {
            "kind": "discrete",
            "order": 4,
            "axes": [{"axis": [0, 0, 1], "point_mm": [0, 0, 12.5], "order": 4}],
            "motions": [[[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]],
        }
    ],
    "ScanQuality": [{"accuracy_mm": 0.02, "noise_mm": 0.011}],
    "FreeMotion": [{"kind": "rotation", "axis": [0, 0, 1], "point_mm": [0, 0, 12.5], "sigma_mm": 3.1}],
    "StudySettings": [{"noise_mm": 0.1, "rotation_deg": 30.0, "eps": 0.01, "count": 20}],
    "Quantiles": [{"n": 100, "p05": 0.7, "p25": 0.85, "p50": 0.9, "p75": 0.95, "p95": 1.0}],
    "Deviation": [{"tolerance_mm": 0.2}],
    "RepeatabilityProtocol": [
        {
            "kind": "repeatability",
            "trials": 5,
            "eps": 0.01,
            "eps_mm": 0.41,
            "count": 20,
            "spacing_mm": 1.03,
            "conditions": ["remeshed", "remeshed, noise 0.1 %"],
        }
    ],
    "RepeatabilityRow": [
        {
            "detector": "t2",
            "condition": "remeshed",
            "mean": 0.9,
            "chance": 0.006,
            "points": 20.0,
            "pose_right": 1.0,
        }
    ],
}


def main() -> None:
    document = create_app(ServiceSettings.model_construct()).openapi()
    FOUND.write_text(as_text(collected(document["components"]["schemas"])))


def collected(schemas: dict[str, Any]) -> dict[str, Any]:
    """`Schema.field` -> the first value of it in the documents that is not null."""
    found: dict[str, Any] = {}
    for name, document in _documents():
        _collect(name, document, schemas, found)
    return dict(sorted(found.items()))


def _documents() -> Iterator[tuple[str, Any]]:
    """Schema and document."""
    for kind in ("registration", "landmarks", "study"):
        yield f"{kind.title()}Result", json.loads((RESULTS / f"results.{kind}.json").read_text())
    of_file = {"job": "Job", "blob": "Blob", "options": "Options", "problem": "Problem"}
    for file, document in examples().items():
        word, kind = file.split(".")[:2]
        yield (f"{kind.title()}Request" if word == "job_request" else of_file[word]), document
    for name, documents in OTHERS.items():
        yield from ((name, each) for each in documents)


def _collect(name: str, document: Any, schemas: dict[str, Any], found: dict[str, Any]) -> None:
    for field, schema in schemas[name].get("properties", {}).items():
        value = document.get(field)
        if value is None:
            continue
        children = [(child, each) for child, each in _children(schema, value) if isinstance(each, dict)]
        for child, each in children:
            _collect(child, each, schemas, found)
        if not children:  # they have examples of their own
            found.setdefault(f"{name}.{field}", _short(value))


def _children(schema: dict[str, Any], value: Any) -> Iterator[tuple[str, Any]]:
    """Schema and value of each object in a field."""
    if "$ref" in schema:
        if isinstance(value, dict):
            yield schema["$ref"].split("/")[-1], value
    elif "discriminator" in schema:
        discriminator = schema["discriminator"]
        yield discriminator["mapping"][value[discriminator["propertyName"]]].split("/")[-1], value
    elif "anyOf" in schema:
        for each in schema["anyOf"]:
            yield from _children(each, value)
    elif isinstance(value, list):
        for each in value:
            yield from _children(schema.get("items", {}), each)


def _short(value: Any) -> Any:
    """Enough to see what it is."""
    if isinstance(value, list):
        numbers = all(isinstance(each, int | float) for each in value)
        rows = all(isinstance(each, list) for each in value)
        return value if numbers or rows else [_short(each) for each in value[:1]]
    if isinstance(value, dict):
        return {key: _short(each) for key, each in list(value.items())[:12]}
    return value


if __name__ == "__main__":
    main()
