"""Which measures of confinement this machine has, in words for operators."""

from dataclasses import dataclass
from functools import cache

from service.execution.confinement import landlock, syscall_filter


@dataclass(frozen=True, slots=True)
class Measures:
    """landlock : version of the kernel's Landlock, 0: none; system_calls : they are filtered by seccomp;
    network_namespace : jobs have one of their own, without an interface
    """

    landlock: int
    system_calls: bool
    network_namespace: bool

    @property
    def missing(self) -> list[str]:
        """What is not confined here, each in a few words; empty when everything is."""
        found = []
        if self.landlock < 1:
            found.append("files: a job can read and write what this user can (the kernel has no Landlock)")
        elif self.landlock < 3:
            found.append("files: a job can truncate files of this user (Landlock is older than version 3)")
        if not self.system_calls:
            found.append("system calls: they are not filtered (libseccomp.so.2 is not installed)")
        if not (self.system_calls or self.network_namespace):
            found.append("network: a job can send over it" + (" by UDP" if self.landlock >= 4 else ""))
        if not self.system_calls and self.landlock < 6:
            found.append("signals: a job can end processes of this user")
        return found


@cache
def available(*, network_namespace: bool = False) -> Measures:
    """What this process could apply to itself."""
    has_filter = syscall_filter.compiled(with_processes=False) is not None
    return Measures(landlock.version(), has_filter, network_namespace)
