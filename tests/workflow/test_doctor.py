"""``doctor`` names each package that miurafab needs; a missing one stops a job."""

from __future__ import annotations

import importlib.metadata

import pytest

import miurafab as mf

REQUIRED = ["numpy>=2.1", "resvg_py>=0.4", "casadi>=3.6; extra == 'bench'"]
VERSIONS = {"numpy": "2.4.6", "resvg_py": "0.4"}


@pytest.fixture
def installed(monkeypatch):
    def version(name):
        if name not in VERSIONS:
            raise importlib.metadata.PackageNotFoundError(name)
        return VERSIONS[name]

    monkeypatch.setattr(importlib.metadata, "requires", lambda name: [*REQUIRED])
    monkeypatch.setattr(importlib.metadata, "version", version)
    return monkeypatch


def test_every_needed_package_has_its_version(installed):
    found = mf.doctor()
    packages = {key: found.versions[key] for key in list(found.versions)[2:]}
    assert packages == VERSIONS
    assert not any("installed" in problem for problem in found.problems)


def test_a_missing_package_stops_a_job(installed, run):
    installed.delitem(VERSIONS, "resvg_py")
    found = mf.doctor()
    assert found.versions["resvg_py"] == "missing"
    assert "resvg_py is not installed; run pip install resvg_py." in found.problems
    done = run("doctor")
    assert done.returncode == 1
    assert "Would stop a job: resvg_py is not installed" in done.stdout


def test_a_source_tree_is_named_as_one(monkeypatch):
    def absent(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "requires", absent)
    assert "miurafab runs from its source and is not installed; run pip install ." in (
        mf.doctor().problems
    )
