"""Campaigns on a real dask cluster of two worker processes: the same numbers, also where a worker
dies."""

import os
import signal

import numpy as np
import pytest
from loops import schedule

import hydroctl as hc
from hydroctl.errors import InputError
from hydroctl.simulation import Scenario
from hydroctl.validation import campaign, connected
from hydroctl.validation.cases import METRICS

distributed = pytest.importorskip("distributed")
ACTUATOR = hc.load_actuator("reference")
ASKED = [
    Scenario(name="step", loop="velocity", Ts=1e-3, y=0.25, reference=0.02 * (np.arange(300) >= 5))
]


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        2, threads_per_worker=1, dashboard_address=None, protocol="tcp"
    ) as made:
        yield made


def rows(executor=None, **changes):
    result = campaign(
        ACTUATOR,
        schedule(),
        count=256,
        seed=7,
        scenarios=ASKED,
        chunk_size=32,
        executor=executor,
        **changes,
    )
    return np.array([result.metrics[name] for name in METRICS])


def test_a_cluster_gives_the_same_bits(cluster):
    with connected(cluster.scheduler_address) as executor:
        assert np.array_equal(rows(executor), rows(), equal_nan=True)


def test_a_killed_worker_loses_nothing(cluster):
    """One worker process is killed when the first chunk is back; the other and its successor do the
    rest."""
    with distributed.Client(cluster) as client:
        workers, killed = list(client.run(os.getpid).values()), []

        def kill_one(done, count):
            if not killed:
                os.kill(workers[0], signal.SIGKILL)
                killed.append(done)

        found = rows(client.get_executor(), on_progress=kill_one)
    assert killed == [32]
    assert np.array_equal(found, rows(), equal_nan=True)


def test_the_command_line_uses_a_scheduler(cluster, command, tmp_path):
    x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.25, 0.5])
    path = hc.tune_fixed(
        ACTUATOR, x, y, specification=hc.Specification(uncertainty="nominal")
    ).save(tmp_path / "schedule.json")
    arguments = "validate", path, "--count", 70, "--seed", 3
    alone = command(*arguments)
    assert command(*arguments, "--scheduler", cluster.scheduler_address) == alone
    assert alone[0] in (0, 1)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    monkeypatch.setattr("hydroctl.validation.cluster._PATIENCE", "300ms")
    for address in ("tcp://127.0.0.1:9", "nonsense://"):
        with pytest.raises(InputError, match="no dask scheduler answers"), connected(address):
            pass
