"""Settings refuse what would be unsafe, and reach child processes unchanged."""

from pathlib import Path

import pytest

from service.settings import ServiceSettings


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_loopback_is_not_exposed(host: str) -> None:
    assert not ServiceSettings(host=host).is_exposed


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "example.org"])  # noqa: S104
def test_elsewhere_is_unless_it_is_meant(host: str) -> None:
    assert ServiceSettings(host=host).is_exposed
    assert not ServiceSettings(host=host, allow_open=True).is_exposed


def test_a_child_process_gets_the_same(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    given = ServiceSettings(
        data_dir=tmp_path, port=0, jobs=3, job_time_limit_s=1.5, allow_open=True, log_level="debug"
    )
    for name, value in given.environment().items():
        monkeypatch.setenv(name, value)
    assert ServiceSettings() == given
    assert all(name.startswith("CUSP_") for name in given.environment())


def test_a_relative_data_folder_is_made_absolute(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Jobs run in folders of their own, where a relative path would lead nowhere; the default is relative
    too.
    """
    monkeypatch.chdir(tmp_path)
    assert ServiceSettings(data_dir=Path("here")).data_dir == tmp_path / "here"
    assert ServiceSettings().data_dir == tmp_path / "cusp-data"


def test_every_setting_is_described() -> None:
    assert all(field.description for field in ServiceSettings.model_fields.values())
