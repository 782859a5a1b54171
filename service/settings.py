"""All settings of the service, read from `CUSP_*` environment variables. All have defaults."""

import os
import re
import socket
from ipaddress import ip_address, ip_network
from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr, ValidationInfo, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from service.ceilings import read_ceilings

MIB = 1024 * 1024


class ServiceSettings(BaseSettings):
    """One object for the API, the worker and the command line; only `cusp` reads the environment."""

    model_config = SettingsConfigDict(env_prefix="CUSP_", frozen=True, extra="ignore", validate_default=True)

    data_dir: Path = Field(Path("cusp-data"), description="databases, blobs, results and temporary files")
    database_url: SecretStr = Field(
        SecretStr(""), description="`postgresql://user:password@host/name`; empty: SQLite in the data folder"
    )
    blob_url: str = Field(
        "",
        description="`s3://bucket/prefix`, with the usual `AWS_*` variables; empty: files in the data folder",
    )
    host: str = Field(
        "127.0.0.1", description="address to listen on; other than loopback needs API keys or allow_open"
    )
    port: int = Field(8000, ge=0, le=65535, description="port to listen on; 0 lets the system choose")
    allow_open: bool = Field(False, description="listen beyond loopback although there are no API keys")
    jobs: int = Field(
        max(1, (os.cpu_count() or 2) // 2), ge=1, le=256, description="jobs run at the same time"
    )
    job_time_limit_s: float = Field(900, gt=0, description="a job that runs longer fails (job_timed_out)")
    job_memory_limit_mib: int = Field(4096, ge=64, description="resident memory of a job (job_out_of_memory)")
    job_disk_limit_mib: int = Field(
        4096, ge=64, description="disk space of a job, with meshes and results (job_out_of_disk)"
    )
    sandbox: Literal["auto", "require"] = Field(
        "auto",
        description="`require`: no start where the kernel cannot confine jobs; `auto`: a warning then",
    )
    max_upload_mib: int = Field(512, ge=1, description="largest request body (payload_too_large)")
    design_cache_mib: int = Field(2048, ge=0, description="size of the cache of design models; 0: no cache")
    retention_h: float = Field(
        720, ge=0, description="hours that final jobs, their files and unused meshes are kept; 0: no limit"
    )
    min_free_disk_mib: int = Field(
        1024,
        ge=0,
        description="free space kept on the data volume: with less /readyz answers not_ready, and uploads "
        "are refused (storage_full)",
    )
    setting_ceilings: str = Field(
        "",
        description="how far clients may raise settings: `load.max_faces=1e7, study.trials=1000`; by default "
        "`load.max_faces`, `load.max_points` and `load.max_archive_expansion` cannot be raised",
    )
    report_company: str = Field("", max_length=200, description="name at the head of every report")
    report_logo: str = Field(
        "", description="path of a PNG or JPEG of at most 256 KiB, at the head of every report; empty: none"
    )
    webhook_networks: str = Field(
        "", description="private networks that webhooks may reach: `10.1.0.0/16, 127.0.0.0/8`"
    )
    mesh_networks: str = Field(
        "", description="private networks that meshes may be fetched from by `url`: `10.1.0.0/16`"
    )
    mesh_fetch_time_limit_s: float = Field(
        120, gt=0, description="a mesh that takes longer to fetch by `url` fails its job (mesh_not_fetched)"
    )
    queue_limit: int = Field(
        20_000, ge=1, description="limit of waiting jobs; beyond it, jobs are refused (queue_full)"
    )
    tenant_queue_limit: int = Field(
        15_000,
        ge=1,
        description="limit of waiting jobs of one tenant; beyond it, jobs are refused (tenant_queue_full)",
    )
    tenant_quota_mib: int = Field(
        0, ge=0, description="limit of stored meshes and results of a tenant (quota_exceeded); 0: no limit"
    )
    tenant_watcher_limit: int = Field(
        5000,
        ge=1,
        description="limit of long polls and event streams of a tenant, for each API (too_many_watchers)",
    )
    rate_limit_per_s: int = Field(
        1000,
        ge=0,
        description="limit of requests per second of one key or address (rate_limited); 0: no limit",
    )
    worker_id: str = Field(
        "",
        pattern=r"^[A-Za-z0-9._-]{0,100}$",
        description="unique and constant name of the worker; empty: worker-1, on PostgreSQL the host name",
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        "info", description="lowest level that is logged"
    )
    log_format: Literal["auto", "console", "json"] = Field("auto", description="auto: console on a terminal")

    @field_validator("database_url", mode="after")
    @classmethod
    def _is_postgresql(cls, url_secret: SecretStr) -> SecretStr:
        url = url_secret.get_secret_value()
        if url and not re.match(r"postgres(ql)?(\+psycopg)?://", url):
            raise ValueError("must be postgresql://user:password@host/name, or empty for SQLite")
        return SecretStr(re.sub(r"^postgres(ql)?(\+psycopg)?://", "postgresql+psycopg://", url))

    @field_validator("webhook_networks", "mesh_networks", mode="after")
    @classmethod
    def _are_networks(cls, networks: str) -> str:
        for word in filter(None, (each.strip() for each in networks.split(","))):
            ip_network(word)  # raises ValueError with the reason
        return networks

    @field_validator("setting_ceilings", mode="after")
    @classmethod
    def _are_ceilings(cls, text: str) -> str:
        read_ceilings(text)  # raises ValueError with the reason
        return text

    @field_validator("worker_id", mode="after")
    @classmethod
    def _has_a_name(cls, name: str, others: ValidationInfo) -> str:
        database_url: SecretStr = others.data.get("database_url", SecretStr(""))
        return name or (socket.gethostname() if database_url.get_secret_value() else "worker-1")

    @field_validator("blob_url", mode="after")
    @classmethod
    def _is_s3(cls, url: str) -> str:
        if url and not re.match(r"s3://[^/]+", url):
            raise ValueError(
                "must be s3://bucket or s3://bucket/prefix, or empty for files in the data folder"
            )
        return url

    @field_validator("data_dir", mode="after")
    @classmethod
    def _absolute(cls, data_dir: Path) -> Path:
        """Jobs run in folders of their own, where a relative path would be wrong."""
        return data_dir.expanduser().absolute()

    @property
    def ceilings(self) -> dict[str, float]:
        """Ceilings of settings of jobs, by `section.name`."""
        return read_ceilings(self.setting_ceilings)

    @property
    def is_exposed(self) -> bool:
        """True if other machines can reach the address and `allow_open` is not set."""
        return not self.allow_open and not _is_loopback(self.host)

    @property
    def is_embedded(self) -> bool:
        """True on SQLite: one service owns the data folder."""
        return not self.database_url.get_secret_value()

    @property
    def database(self) -> str:
        """URL of the tables of jobs."""
        return self.database_url.get_secret_value() or f"sqlite:///{self.data_dir / 'cusp.db'}"

    @property
    def queue(self) -> str:
        """URL of the tables of DBOS, which order the jobs. On PostgreSQL they have a schema of their own."""
        return self.database_url.get_secret_value() or f"sqlite:///{self.data_dir / 'queue.db'}"

    @property
    def blobs(self) -> str:
        """URL of uploaded meshes and result files."""
        return self.blob_url or f"file://{self.blob_dir}"

    @property
    def blob_dir(self) -> Path:
        """Folder of blobs without `blob_url`."""
        return self.data_dir / "blobs"

    @property
    def scratch_dir(self) -> Path:
        """A folder for each running job."""
        return self.data_dir / "scratch"

    @property
    def tmp_dir(self) -> Path:
        """Uploads in progress: on the data volume, since /tmp is often small or in memory."""
        return self.data_dir / "tmp"

    def make_folders(self) -> None:
        """Create the folders, accessible to this user only."""
        for folder in (self.data_dir, self.blob_dir, self.scratch_dir, self.tmp_dir):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)

    def environment(self) -> dict[str, str]:
        """The `CUSP_*` variables that give a child process these settings."""
        values = {name: getattr(self, name) for name in type(self).model_fields}
        return {
            f"CUSP_{name.upper()}": value.get_secret_value() if isinstance(value, SecretStr) else str(value)
            for name, value in values.items()
        }


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False
