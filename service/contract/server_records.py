"""Answers about the server itself: limits, version, health."""

from typing import Literal

from pydantic import Field

from service.contract.model_base import Response


class Limits(Response):
    """What this server accepts."""

    max_upload_mib: int = Field(description="largest request body")
    job_time_limit_s: float = Field(description="a job that runs longer fails with job_timed_out")
    job_memory_limit_mib: int = Field(description="a job that takes more memory fails with job_out_of_memory")
    job_disk_limit_mib: int = Field(description="a job that takes more disk space fails with job_out_of_disk")
    queue_limit: int = Field(description="limit of waiting jobs; beyond it, jobs are refused with queue_full")
    tenant_queue_limit: int = Field(
        description="limit of waiting jobs of one tenant; beyond it, jobs are refused with tenant_queue_full"
    )
    tenant_quota_mib: int = Field(
        description="limit of stored meshes and results of a tenant; beyond it, uploads and jobs are refused "
        "with quota_exceeded; 0: no limit"
    )
    tenant_stored_mib: float = Field(description="meshes and results that the caller's tenant has stored")
    rate_limit_per_s: int = Field(
        description="limit of requests per second of one key or address; 0: no limit"
    )
    parallel_jobs: int = Field(description="jobs that run at the same time")
    job_types: list[str] = Field(description="values of `type` that this version supports")
    formats: list[str] = Field(description="supported mesh formats")
    setting_ceilings: dict[str, float] = Field(
        description="how far `options.settings` may raise a setting (`section.name`); beyond: invalid_options"
    )


class SandboxMeasures(Response):
    """How jobs are confined, on the machine that answers."""

    landlock: int = Field(description="version of Landlock; 0: the kernel has none or does not allow it")
    system_calls_filtered: bool = Field(description="by seccomp")
    missing: list[str] = Field(description="what is not confined; empty: everything is")


class Version(Response):
    """Version of the service."""

    name: Literal["cusp"] = Field("cusp", description="of the service")
    version: str = Field(description="of Cusp")
    schema_version: Literal["1"] = Field("1", description="of the results")
    sandbox: SandboxMeasures = Field(description="how jobs are confined")


class Health(Response):
    """Answer of the probes."""

    status: Literal["ok"] = Field("ok", description="ready; otherwise the answer is a problem")
