"""What a machine lacks is said, once, and refuses the start where it is required."""

import ctypes
import threading
from pathlib import Path

import pytest
import structlog

from service.contract.schemas import Version
from service.execution.confinement import landlock, syscall_filter
from service.execution.confinement.measures import Measures, available
from service.execution.sandbox import SandboxError
from service.execution.worker_process import _check_measures
from service.execution.zygote_link import ZygoteLink
from tests.support.service import Service

FULL = Measures(landlock=7, system_calls=True, network_namespace=False)
NOTHING = Measures(landlock=0, system_calls=False, network_namespace=False)


def test_each_measure_that_is_missing_is_named() -> None:
    assert FULL.missing == []
    assert [each.split(":")[0] for each in NOTHING.missing] == ["files", "system calls", "network", "signals"]
    assert [each.split(":")[0] for each in Measures(2, True, False).missing] == ["files"]
    assert [each.split(":")[0] for each in Measures(6, False, True).missing] == ["system calls"]


@pytest.mark.parametrize("is_required", [False, True])
def test_what_is_missing_is_one_warning_or_no_start(is_required: bool) -> None:
    with structlog.testing.capture_logs() as logs:
        if is_required:
            with pytest.raises(SandboxError, match="CUSP_SANDBOX=require"):
                _check_measures(NOTHING, is_required=True)
        else:
            _check_measures(NOTHING, is_required=False)
        _check_measures(FULL, is_required=is_required)
    assert [each["log_level"] for each in logs] == (["info"] if is_required else ["warning", "info"])


def test_the_version_says_how_jobs_are_confined(service: Service) -> None:
    sandbox = Version.model_validate(service.http.get("/version").json()).sandbox
    assert (sandbox.landlock, sandbox.missing) == (available().landlock, available().missing)


def test_a_kernel_without_landlock_has_version_0(monkeypatch: pytest.MonkeyPatch) -> None:
    class Refusing:
        def syscall(self, *_: object) -> int:
            return -1

    monkeypatch.setattr(landlock, "_libc", Refusing)
    assert landlock.version() == 0
    with pytest.raises(OSError, match="Landlock is refused"):
        landlock.restrict([])


def test_without_libseccomp_there_is_no_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object, **__: object) -> None:
        raise OSError("libseccomp.so.2: cannot open shared object file")

    monkeypatch.setattr(ctypes, "CDLL", missing)
    assert syscall_filter.compiled(with_processes=False) is None


def test_the_folder_in_which_the_service_starts_is_no_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be the data folder: neither its modules are imported nor may jobs read it."""
    (tmp_path / "json.py").write_text("raise RuntimeError('not the json of the library')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent / "misbehaving"))
    link = ZygoteLink("obedient")
    try:
        assert link.measures.landlock == available().landlock
    finally:
        link.close()
    assert "zygote events" not in [thread.name for thread in threading.enumerate()]
