"""Limits of resources of a job's process."""

import resource

from service.execution import process

MIB = 1024 * 1024
MIN_FILE_LIMIT_BYTES = 1024 * MIB  # a file of results may be larger than a small limit of memory
MAX_OPEN_FILES = 512  # a job has some tens open: libraries, the mesh, results
MAX_TASKS_OF_USER = 4096  # the kernel counts the threads of all jobs; the zygote counts those of one


def limit_resources(memory_limit_bytes: int) -> None:
    """Set limits that cannot be raised again."""
    largest_file = max(memory_limit_bytes, MIN_FILE_LIMIT_BYTES)
    for limit, value in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, largest_file),
        (resource.RLIMIT_NOFILE, MAX_OPEN_FILES),
        (resource.RLIMIT_MSGQUEUE, 0),
        (resource.RLIMIT_NPROC, MAX_TASKS_OF_USER),
    ):
        _, hard = resource.getrlimit(limit)
        lowest = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(limit, (lowest, lowest))
    # The zygote enforces the limit of resident memory: thread stacks, allocator arenas and libraries reserve
    # gigabytes of addresses that they never touch. This limit stops what grows faster than the zygote polls.
    process.limit_address_space(2 * memory_limit_bytes)
