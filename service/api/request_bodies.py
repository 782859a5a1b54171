"""The body of `POST /v1/jobs` for the OpenAPI document. FastAPI cannot infer it: `intake.py` reads the
request.
"""

from typing import Any

from service.contract.job_types import ALL_MESHES, JOB_TYPES, MESHES
from service.contract.schemas import JobType, LandmarksRequest, Options, RegistrationRequest, StudyRequest

REQUESTS = (RegistrationRequest, LandmarksRequest, StudyRequest)
EXTRA_SCHEMAS = (*REQUESTS, Options)  # named by JOB_BODY only
ABOUT = {
    "design": "the design mesh",
    "scan": "the scan mesh, or points",
    "mesh": "the mesh of landmarks or a study",
}


def _form(job_type: JobType) -> dict[str, Any]:
    """The form parts that a type needs, and those that it refuses."""
    needed, others = list(MESHES[job_type]), [name for name in ALL_MESHES if name not in MESHES[job_type]]
    return {
        "title": job_type,
        "required": needed if job_type == "registration" else ["type", *needed],
        "properties": {"type": {"const": job_type}},
        "not": {"anyOf": [{"required": [name]} for name in others]},
    }


def _reference(name: str) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{name}"}


# One object with all parts: Swagger UI (/docs) shows input fields only for a single object.
_FORM: dict[str, Any] = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        **{name: {"type": "string", "format": "binary", "description": ABOUT[name]} for name in ALL_MESHES},
        "type": {"type": "string", "enum": list(JOB_TYPES), "default": "registration"},
        "options": _reference("Options"),
    },
    "oneOf": [_form(job_type) for job_type in JOB_TYPES],
}
JOB_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {
                "schema": _FORM,
                "encoding": {"options": {"contentType": "application/json"}},
            },
            "application/json": {"schema": {"oneOf": [_reference(model.__name__) for model in REQUESTS]}},
        },
    }
}
