"""Is there room for what a client sends: on the disk, and in the quota of its tenant."""

import shutil

from service.api.dependencies import Api
from service.auth.keys import Caller
from service.contract.errors import QuotaExceeded, StorageFull
from service.settings import MIB

CHECK_BYTES = 8 * MIB  # of a body, between two checks while it arrives


def check_disk(api: Api, size: int) -> None:
    """Raise StorageFull if `size` more bytes would leave less than the free space that is to be kept.

    Uploads pass over the data volume, also on their way to a bucket.
    """
    free = shutil.disk_usage(api.settings.data_dir).free
    if free - size < api.settings.min_free_disk_mib * MIB:
        api.metrics.add({"cusp_uploads_refused": {"disk": 1}})
        raise StorageFull(
            f"too little room on the data volume of the service: {free // MIB} MiB are free, and "
            f"{api.settings.min_free_disk_mib} MiB must stay free; send it again later, or tell the operator"
        )


def check_quota(api: Api, caller: Caller, size: int) -> None:
    """Raise QuotaExceeded if `size` more bytes, beside those that arrive, would exceed the quota."""
    quota = api.settings.tenant_quota_mib * MIB
    if not quota:
        return
    used = api.jobs.stored_bytes(caller.tenant) + api.arriving.of(caller.tenant)
    if used + size > quota:
        api.metrics.add({"cusp_uploads_refused": {"quota": 1}})
        raise QuotaExceeded(
            f"meshes and results of this tenant take {used // MIB} MiB, and the quota is "
            f"{api.settings.tenant_quota_mib} MiB; remove jobs that are no longer needed, or wait until the "
            "service removes old ones"
        )
