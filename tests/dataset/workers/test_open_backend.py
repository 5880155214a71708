"""Backends: what cannot be opened is refused with a command that works."""

from __future__ import annotations

import pytest

import dataset.workers.open_backend
from dataset.storage.storage import RemoteStorage
from dataset.workers.open_backend import check_backend
from sim.io.errors import InputError


@pytest.mark.parametrize(
    ("name", "command"), [("dask", r"pip install 'dask\[distributed\]'"), ("ray", "install 'ray'")]
)
def test_a_missing_package_is_named_as_it_is_installed(
    name: str, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The advice used to be an extra of this package, which is on no package index."""
    monkeypatch.setattr(dataset.workers.open_backend, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=command):
        check_backend(name, 1)


def test_a_missing_package_of_a_url_is_named_as_it_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: str) -> None:
        raise ImportError("Install s3fs to access S3")

    monkeypatch.setattr("fsspec.core.url_to_fs", missing)
    with pytest.raises(InputError, match="pip install s3fs"):
        RemoteStorage("s3://bucket/folder")


def test_an_unknown_backend_and_no_workers_are_refused() -> None:
    with pytest.raises(InputError, match="allowed are"):
        check_backend("slurm", 1)
    with pytest.raises(InputError, match="jobs = 0"):
        check_backend("loky", 0)
