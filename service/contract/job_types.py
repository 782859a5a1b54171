"""The types of jobs: which meshes each takes, and which options apply to it.

An option or a mesh that does not apply is refused by name, since the client expects an effect that it would
not have.
"""

from collections.abc import Iterable
from typing import get_args

from service.contract.errors import InvalidOptions, InvalidRequest, UnsupportedType
from service.contract.schemas import JobType, Options, ProblemItem

JOB_TYPES: tuple[JobType, ...] = get_args(JobType)
MESHES: dict[JobType, tuple[str, ...]] = {
    "registration": ("design", "scan"),
    "landmarks": ("mesh",),
    "study": ("mesh",),
}
ALL_MESHES = ("design", "scan", "mesh")
OPTIONS_OF_ONE_TYPE: dict[str, JobType] = {
    "tolerance_mm": "registration",
    "scan_accuracy_mm": "registration",
    "acceptance": "registration",
    "reference": "registration",
    "alignment": "registration",
    "design_part": "registration",
    "columns": "registration",
    "study": "study",
}


def parse_type(value: object) -> JobType:
    """The type of a job. Raises UnsupportedType."""
    if value not in JOB_TYPES:
        raise UnsupportedType(
            f"type {value!r}: must be {', '.join(JOB_TYPES[:-1])} or {JOB_TYPES[-1]}; without a type it "
            f"is {JOB_TYPES[0]}"
        )
    return value


def check_meshes(job_type: JobType, parts: Iterable[str]) -> None:
    """Raise InvalidRequest when one of `parts` is a mesh of another type of job."""
    for name in parts:
        if name in ALL_MESHES and name not in MESHES[job_type]:
            others = " or ".join(each for each in JOB_TYPES if name in MESHES[each])
            mine = " and ".join(MESHES[job_type])
            raise wrong_part(name, f"a {job_type} job takes {mine} instead; {name} is for type {others}")


def check_options(job_type: JobType, options: Options) -> None:
    """Raise InvalidOptions if an option does not apply to this type of job."""
    for name, only in OPTIONS_OF_ONE_TYPE.items():
        if only != job_type and getattr(options, name) is not None:
            raise _not_applicable(
                name, f"does not apply to a {job_type} job; leave it out, or send type {only}"
            )
    for mesh, unit in options.units:
        if unit != "auto" and mesh not in MESHES[job_type]:
            mine = " and ".join(MESHES[job_type])
            raise _not_applicable(
                f"units/{mesh}", f"a {job_type} job has no such mesh, only {mine}; leave the unit out"
            )


def wrong_part(name: str, detail: str) -> InvalidRequest:
    """The problem of a part of a request."""
    return InvalidRequest(f"{name}: {detail}", errors=[ProblemItem(pointer=f"/{name}", detail=detail)])


def _not_applicable(path: str, detail: str) -> InvalidOptions:
    pointer = f"/options/{path}"
    return InvalidOptions(
        f"options.{path.replace('/', '.')}: {detail}", errors=[ProblemItem(pointer=pointer, detail=detail)]
    )
