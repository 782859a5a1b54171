"""The limits of one job."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """disk_mib : of the folder of the job, with its meshes and results; memory_mib : of all its processes"""

    time_s: float
    memory_mib: int
    disk_mib: int = 4096
