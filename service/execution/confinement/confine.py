"""Puts all measures together: prepared once in the zygote, applied in each child before it reads anything."""

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from service.execution.confinement import landlock, privileges, readable, syscall_filter
from service.execution.confinement.measures import Measures


@dataclass(frozen=True, slots=True)
class Confinement:
    """measures : those that are applied; filter : of system calls, by whether the job starts processes"""

    measures: Measures
    filters: dict[bool, bytes]
    libraries: list[Path]
    facts: list[Path]

    @classmethod
    def prepare(cls) -> "Confinement":
        """For the zygote, after its imports. Puts the zygote itself into a network namespace, if it may."""
        programs = {each: syscall_filter.compiled(with_processes=each) for each in (False, True)}
        filters = {each: program for each, program in programs.items() if program is not None}
        measures = Measures(landlock.version(), len(filters) == 2, privileges.leave_network())
        return cls(measures, filters, readable.libraries(), readable.facts())

    def apply(self, folder: Path, *, with_processes: bool) -> None:
        """Confine this process to its folder, for good.

        Raises OSError when a measure that the machine has is refused: the job must not run without it.
        """
        os.environ["TMPDIR"] = os.environ["XDG_CACHE_HOME"] = str(folder)
        tempfile.tempdir = None
        privileges.give_up_new_privileges()
        privileges.drop_capabilities()
        if self.measures.landlock:
            landlock.restrict(self._allowed(folder, landlock.RUN if with_processes else landlock.READ))
        if self.measures.system_calls:
            syscall_filter.install(self.filters[with_processes])

    def _allowed(self, folder: Path, of_libraries: int) -> list[tuple[Path, int]]:
        return [
            (folder, landlock.OWN),
            (Path(os.devnull), landlock.DEVICE),
            *((place, of_libraries) for place in readable.without_parents_of(folder, self.libraries)),
            *((place, landlock.READ) for place in readable.without_parents_of(folder, self.facts)),
        ]
