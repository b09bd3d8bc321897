"""A sweep on a cluster of worker processes, of which one is killed, or all.

The cluster is that of the compose file in print: its commands, as processes of this computer, where
the scheduler has an address of its own instead of a name.
"""

import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pytest
from pages import ROOT, blocks_of

import miurafab as mf
from miurafab.errors import InputError
from miurafab.workflow import tradeoff as tradeoff_module
from miurafab.workflow.tradeoff import _results

distributed = pytest.importorskip("distributed")
yaml = pytest.importorskip("yaml")
SIDES = (4, 5, 6, 7)
PAGE = ROOT / "docs" / "how-to" / "cluster.md"


def _services():
    (file,) = [block.text for block in blocks_of(PAGE) if block.language == "yaml"]
    return yaml.safe_load(file)["services"]


class Cluster:
    """The processes of the services, each the leader of a group; mutable: they end one by one."""

    def __init__(self, folder):
        self.folder = folder
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        services = _services()
        self.scheduler = self._started(services["scheduler"])
        replicas = range(services["worker"]["deploy"]["replicas"])
        self.workers = [self._started(services["worker"]) for _ in replicas]

    def _started(self, service):
        words = [service["entrypoint"], *shlex.split(service["command"])]
        named = {"tcp://scheduler:8786": self.address, "8786": str(self.port)}
        words = [named.get(word, word) for word in words]
        # containers do not share the port of the dashboard
        words += ["--no-dashboard"]
        beside = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        return subprocess.Popen(
            words,
            cwd=self.folder,
            env={**os.environ, "PATH": beside, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def wait(self):
        """Until every worker has found the scheduler."""
        until = time.monotonic() + 120
        while True:
            try:
                with distributed.Client(self.address, timeout="5s") as client:
                    client.wait_for_workers(len(self.workers), timeout=60)
                return
            except OSError:  # it does not listen yet
                assert time.monotonic() < until

    def kill(self, process):
        """As when a computer loses power: the process and all that it started."""
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def close(self):
        for process in (*self.workers, self.scheduler):
            if process.returncode is None:
                self.kill(process)


@pytest.fixture
def cluster(tmp_path):
    started = Cluster(tmp_path)
    try:
        started.wait()
        yield started
    finally:
        started.close()


def test_nothing_is_lost_with_a_worker(cluster):
    def told(done, _text):
        if done > 0 and cluster.workers[0].returncode is None:
            cluster.kill(cluster.workers[0])

    found = mf.tradeoff("hypar", SIDES, cluster=cluster.address, on_progress=told)
    assert cluster.workers[0].returncode == -signal.SIGKILL
    assert found == mf.tradeoff("hypar", SIDES, workers=1)


def test_the_services_run_what_the_image_has():
    """The image's own program is miurafab: another one is named as entry point, and installed."""
    image = (ROOT / "Containerfile").read_text()
    assert '\nENTRYPOINT ["miurafab"]\n' in image
    assert "--requirement /source/locks/extras.txt" in image  # which has dask, see test_packaging
    for service in _services().values():
        assert service["image"] == "miurafab"
        assert ("entrypoint" in service) == ("command" in service)
        assert service.get("entrypoint", "dask") == "dask"


def test_a_cluster_without_workers_is_given_time_and_then_told(monkeypatch):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=0, threads_per_worker=1, processes=False, dashboard_address=None
        ) as started:
            monkeypatch.setattr(tradeoff_module, "_JOINING_S", 0.1)
            with pytest.raises(InputError, match="has no workers; start one and try again"):
                mf.tradeoff("hypar", SIDES[:3], cluster=started.scheduler_address)
            monkeypatch.setattr(tradeoff_module, "_JOINING_S", 60)
            threading.Timer(0.5, started.scale, [1]).start()
            found = mf.tradeoff("hypar", SIDES[:3], cluster=started.scheduler_address)
    assert len(found.found) == 3


def test_workers_without_miurafab_are_told():
    class Future:
        def result(self):
            raise ModuleNotFoundError("No module named 'miurafab'")

    with pytest.raises(InputError, match=r"tcp://a:1 cannot load miurafab: .*\. Install it there"):
        next(_results([Future()], "tcp://a:1"))


@pytest.mark.large
def test_a_scheduler_that_ends_in_mid_run_is_told(cluster):
    def told(done, _text):
        if done > 0:
            cluster.close()

    with pytest.raises(InputError, match="lost its workers or its scheduler"):
        mf.tradeoff("hypar", SIDES, cluster=cluster.address, on_progress=told)
