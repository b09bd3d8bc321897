"""A sweep on a cluster of worker processes, of which one is killed, or all.

The cluster is ``dask.distributed``'s own, on this computer.
"""

import os
import signal
import warnings

import pytest

import miurafab as mf
from miurafab.errors import InputError
from miurafab.workflow.tradeoff import _results

distributed = pytest.importorskip("distributed")
SIDES = (4, 5, 6, 7)


@pytest.fixture
def cluster():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as started:
            yield started


def _kill_one_when(cluster, fraction):
    """A report of progress that kills one worker, once, when the sweep has come so far."""
    killed = []

    def told(done, _text):
        if done > fraction and not killed:
            killed.append(next(iter(cluster.workers.values())).process.pid)
            os.kill(killed[0], signal.SIGKILL)

    return told, killed


def test_nothing_is_lost_with_a_worker(cluster):
    told, killed = _kill_one_when(cluster, 0.0)
    found = mf.tradeoff("hypar", SIDES, cluster=cluster.scheduler_address, on_progress=told)
    assert killed
    assert found == mf.tradeoff("hypar", SIDES, workers=1)


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
        mf.tradeoff("hypar", SIDES, cluster=cluster.scheduler_address, on_progress=told)
