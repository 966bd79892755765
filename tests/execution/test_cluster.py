"""Jobs, studies and ensembles on a Dask cluster of two real workers: what the local pool gives, whoever dies."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pendbench as pb
from pendbench.base.errors import InputError
from pendbench.engines.analytic import chunks
from pendbench.execution import cluster as module
from pendbench.execution import connect
from pendbench.execution.cluster import Batches, DaskPool
from pendbench.execution.pool import Job, LocalPool, Outcome
from pendbench.execution.store import Store
from pendbench.report.tables import data_frame
from pendbench.study.__main__ import main
from support import job_functions as does
from support.clock import clocked
from support.processes import assert_gone
from support.tiny_study import SMALL_ENGINES, SMALL_HEAD, Log, run, write_study

distributed = pytest.importorskip("distributed")
dask = pytest.importorskip("dask")

WORKERS = 2
EVERY_WORKER_DIED = "the workers that ran it died, one after the other"


def made_cluster(workers: int):
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}):  # the fewer are killed, the shorter it takes
        return distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=0, silence_logs=100
        )


@pytest.fixture(scope="module", autouse=True)
def _dask_gives_up_on_no_worker():
    with dask.config.set({"distributed.deploy.lost-worker-timeout": 1200}):
        yield


@pytest.fixture(scope="module")
def cluster():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(__file__).parents[1]), prepend=os.pathsep)
        with made_cluster(WORKERS) as made:
            yield made


@pytest.fixture(scope="module")
def address(cluster) -> str:
    return cluster.scheduler_address


@pytest.fixture(scope="module")
def pool(address):
    with DaskPool(address) as made:
        yield made


def job(function, *arguments, key: str = "", limit: float = 60.0, **limits: float) -> Job:
    return Job(key or function.__name__, function, arguments, limit, **limits)


def numbered(count: int) -> list[Job]:
    return [job(does.identity, i, key=str(i)) for i in range(count)]


def outcomes(pool, jobs, *, alone: bool = False) -> dict[str, Outcome]:
    found = list(pool.run(jobs, alone=alone))
    assert len(found) == len({outcome.job.key for outcome in found}) == len(jobs)
    return {outcome.job.key: outcome for outcome in found}


def values(found: dict[str, Outcome]) -> dict[str, object]:
    assert not [outcome.fault for outcome in found.values() if outcome.fault]
    return {key: outcome.value for key, outcome in found.items()}


def up(cluster) -> list:
    """The workers that have come up, as the processes that look after them know."""
    running = distributed.core.Status.running
    return [each for each in cluster.workers.values() if each.process is not None and each.process.status == running]


def kill_a_worker(cluster) -> int:
    """Kill one that has come up: Dask gives up on those that die before. It may have given up on one for being slow."""
    for _ in range(6000):
        if len(up(cluster)) == WORKERS:
            break
        time.sleep(0.01)
    while not up(cluster):
        time.sleep(0.01)
    pid = up(cluster)[0].pid
    os.kill(pid, signal.SIGKILL)
    return pid


def test_every_job_comes_back_with_its_own_value(pool):
    assert pool.workers == WORKERS
    assert values(outcomes(pool, numbered(300))) == {str(i): i for i in range(300)}
    assert outcomes(pool, []) == {}


def test_as_many_run_at_once_as_there_are_workers(pool, tmp_path):
    # Each waits for the other: run one after the other, both would time out.
    found = values(outcomes(pool, [job(does.meet, str(tmp_path), key, 1, key=key) for key in "ab"]))
    assert found == {"a": 1, "b": 1}


def test_alone_means_one_at_a_time_and_by_one_worker(pool, tmp_path):
    jobs = [job(does.stay, str(tmp_path), str(i), key=str(i)) for i in range(4)]
    assert [outcome.value for outcome in pool.run(jobs, alone=True)] == [[]] * 4
    parents = [job(does.parent, key=str(i)) for i in range(6)]
    assert len({outcome.value for outcome in pool.run(parents, alone=True)}) == 1


FAULTS = [
    job(does.fail),
    job(does.fail_awkwardly),
    job(does.exhaust),
    job(does.kill_itself),
    job(does.leave_at_once),
    job(does.unpicklable),
    job(does.sleep, 3600.0, wall_limit=2.0),
    job(does.spin_compiled, limit=0.5),
    *(
        [job(does.take, 20.0, memory_limit=0.6), job(does.take_or_abort, 20.0, memory_limit=0.6)]
        if sys.platform == "linux"
        else []
    ),
]


def test_faults_are_those_of_the_local_pool_and_the_others_go_on(pool, capfd):
    jobs = [each for pair in zip(FAULTS, numbered(len(FAULTS)), strict=True) for each in pair]
    found = outcomes(pool, jobs)
    with LocalPool(WORKERS) as local:
        expected = outcomes(local, jobs)
    assert {key: (each.value, each.fault) for key, each in found.items()} == {
        key: (each.value, each.fault) for key, each in expected.items()
    }
    assert {found[each.key].fault.status for each in FAULTS} >= {"error", "crashed", "timed out", "out of memory"}
    assert capfd.readouterr() == ("", "")


def test_a_function_that_workers_cannot_find_is_an_outcome(pool, monkeypatch):
    function = type(does.identity)(does.identity.__code__, vars(does), "only_here")
    function.__qualname__ = "only_here"
    monkeypatch.setattr(does, "only_here", function, raising=False)
    found = outcomes(pool, [job(function, 1, key="bad"), job(does.identity, 1, key="good")])
    assert found["bad"].fault.status == "error"
    assert "only_here" in found["bad"].fault.reason
    assert found["good"].value == 1


def test_bad_input_found_by_a_job_is_bad_input(pool):
    with pytest.raises(InputError, match=r"^dt is 0; allowed: above 0$"):
        outcomes(pool, [*numbered(3), job(does.refuse)])


def test_a_worker_that_is_killed_in_the_middle_loses_nothing(pool, cluster):
    found, pid = [], None
    for outcome in pool.run([job(does.nap, i, 0.02, key=str(i)) for i in range(100)]):
        found.append(outcome.value)
        pid = pid or kill_a_worker(cluster)
    assert sorted(found) == list(range(100))


def test_a_job_that_kills_its_workers_is_an_outcome_and_its_neighbours_are_not(pool, monkeypatch):
    monkeypatch.setattr(module, "Batches", lambda jobs, most: Batches(jobs, most, 4))
    jobs = numbered(16)
    jobs.insert(5, job(does.kill_parent, key="kills"))
    with dask.config.set({"distributed.comm.timeouts.connect": 10}):  # s; what a dead worker had done, Dask asks it for
        found = outcomes(pool, jobs)
    assert found.pop("kills").fault == ("crashed", EVERY_WORKER_DIED)
    assert values(found) == {str(i): i for i in range(16)}


def test_batches_grow_with_what_jobs_took():
    batches = Batches(range(1000))
    assert batches.take() == [0]
    for size in (2, 4, 8):
        batches.learn(1, 1e-3)
        assert len(batches.take()) == size
    batches.learn(8, 8 * 0.05)
    assert len(batches.take()) == 4, "as many as take 0.2 s"
    batches.learn(1, 60.0)
    assert batches.take() == [19]
    batches.give_back([3, 4])
    assert [*batches.take(), *batches.take(), *batches.take()] == [3, 4, 20]


def test_batches_have_a_largest_size_and_an_end():
    batches = Batches(range(7), most=3)
    for _ in range(5):
        batches.learn(1, 0.0)
    assert [batches.take() for _ in range(4)] == [[0, 1, 2], [3, 4, 5], [6], []]


class Count(module._Tasks):
    """Counts tasks."""

    sent = 0

    def send(self, batch, worker=None):
        Count.sent += 1
        super().send(batch, worker)


def test_short_jobs_share_a_task(pool, monkeypatch):
    monkeypatch.setattr(module, "_Tasks", Count)
    monkeypatch.setattr(module, "_WORTH_S", 600.0)  # however slow this machine is
    monkeypatch.setattr(Count, "sent", 0)
    assert len(values(outcomes(pool, numbered(500)))) == 500
    assert 4 <= Count.sent <= 50


def test_what_a_task_does_not_get_to_is_handed_out_again(pool, monkeypatch):
    monkeypatch.setattr(module, "_Tasks", Count)
    monkeypatch.setattr(module, "_WORTH_S", 0.0)  # one job, and a task has gone on for too long
    monkeypatch.setattr(module, "Batches", lambda jobs, most: Batches(jobs, most, 5))
    monkeypatch.setattr(Count, "sent", 0)
    assert values(outcomes(pool, numbered(20))) == {str(i): i for i in range(20)}
    assert Count.sent == 20


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return write_study(tmp_path_factory.mktemp("study"), SMALL_ENGINES, SMALL_HEAD, "small")


@pytest.fixture(scope="module")
def expected(study, tmp_path_factory) -> pd.DataFrame:
    return rows(run(study, tmp_path_factory.mktemp("local"), jobs=WORKERS))


def rows(finished) -> pd.DataFrame:
    """The cases, but for the columns of times."""
    cases = data_frame(finished.report.cases)
    kept = cases[[name for name in cases.columns if name not in clocked()]]
    assert len(kept) == 4
    assert kept.error_max.notna().all()
    return kept


def test_a_cluster_of_this_machine_gives_the_rows_of_the_local_pool(study, expected, tmp_path):
    finished = run(study, tmp_path, cluster="local", jobs=WORKERS)
    pd.testing.assert_frame_equal(rows(finished), expected, check_exact=True)
    assert finished.report.results.provenance["cluster"] == "local"
    assert finished.report.results.provenance["worker processes"] == WORKERS
    assert data_frame(finished.report.cases).step_us.notna().all()


class Killer(Log):
    """Kills a worker in the midst of each stage."""

    def __init__(self, cluster) -> None:
        super().__init__()
        self.cluster, self.killed = cluster, []

    def begin(self, stage: str, total: int, done: int) -> None:
        super().begin(stage, total, done)
        self.killed.append(kill_a_worker(self.cluster))


def test_a_study_whose_workers_are_killed_gives_the_same_rows(study, expected, cluster, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    killer = Killer(cluster)
    finished = run(study, Path("out"), cluster=cluster.scheduler_address, log=killer)
    pd.testing.assert_frame_equal(rows(finished), expected, check_exact=True)
    assert len(killer.killed) == len(killer.stages) > 3
    again = Log()
    run(study, Path("out"), cluster=cluster.scheduler_address, log=again)
    assert all(total == done for total, done in again.stages.values())
    assert len(list(Path("out/work").glob("*.json"))) == sum(total for total, _ in again.stages.values())


class Elsewhere(Store):
    """A folder that is another one on another machine."""

    def __reduce__(self):
        return Store, (self.folder.parent / "elsewhere" / "work",)


def test_a_worker_that_does_not_see_the_folder_is_told_of_before_anything_runs(address, tmp_path):
    store = Elsewhere(tmp_path / "work")
    with pytest.raises(InputError, match=r"does not see --out .*elsewhere; allowed: a folder that every machine sees"):
        DaskPool(address, store=store).__enter__()
    assert list(store.folder.iterdir()) == []


def test_a_worker_with_another_version_is_told_of(address, monkeypatch):
    monkeypatch.setattr(module, "source_digest", lambda: "another")
    with pytest.raises(InputError, match="has another version of pendbench; allowed: the same on every machine"):
        DaskPool(address).__enter__()


def test_workers_are_asked_again_where_one_dies_while_it_is_asked(address, monkeypatch):
    """As its connection then breaks; three are asked: for their versions, their pools, the processor of the first."""
    monkeypatch.setattr(connect, "_PAUSES_S", (0.0,))
    broken, run = [], distributed.Client.run

    def run_at_the_second_try(client, function, *arguments, **options):
        if function not in broken:
            broken.append(function)
            raise distributed.comm.CommClosedError("in <TCP (closed)>: ConnectionResetError")
        return run(client, function, *arguments, **options)

    monkeypatch.setattr(distributed.Client, "run", run_at_the_second_try)
    with DaskPool(address) as made:
        assert values(outcomes(made, numbered(3))) == {"0": 0, "1": 1, "2": 2}
    assert len(broken) == 3


def test_who_does_not_answer_is_asked_again_and_not_for_ever(monkeypatch):
    monkeypatch.setattr(connect, "_PAUSES_S", (0.0, 0.0))
    answers = iter([ConnectionResetError("gone"), 7, *[ConnectionResetError("gone")] * 3])

    def ask():
        if isinstance(answer := next(answers), Exception):
            raise answer
        return answer

    assert connect.asked_again(ask) == 7
    with pytest.raises(ConnectionResetError):
        connect.asked_again(ask)
    assert next(answers, None) is None


def test_nothing_is_left_on_the_workers(address):
    with DaskPool(address) as pool:
        name, pid = pool._name, next(iter(pool.run([job(os.getpid)]))).value
    with distributed.Client(address, set_as_default=False) as client:
        plugins = client.run(lambda dask_worker: [each for each in dask_worker.plugins if each == name])
    assert plugins
    assert not any(plugins.values())
    assert_gone(pid)


def test_ensembles_are_those_of_threads(address):
    angles = np.random.default_rng(5).uniform(-3.0, 3.0, (9000, 2))
    here = pb.simulate_ensemble("double", angles, times=[0.2, 0.5])
    there = pb.simulate_ensemble("double", angles, times=[0.2, 0.5], cluster=address)
    np.testing.assert_array_equal(there.theta, here.theta)
    np.testing.assert_array_equal(there.omega, here.omega)
    np.testing.assert_array_equal(there.status, here.status)
    few = angles[:500]
    np.testing.assert_array_equal(pb.first_flips("double", few, cluster=address), pb.first_flips("double", few))


def test_a_worker_that_is_killed_does_not_cost_an_ensemble_anything(cluster, address):
    angles = np.random.default_rng(6).uniform(-3.0, 3.0, (30_000, 2))
    told = []

    def progress(done, _total):
        told.append(done)
        if len(told) == 1:
            kill_a_worker(cluster)

    there = pb.simulate_ensemble("double", angles, times=[0.1], cluster=address, progress=progress)
    np.testing.assert_array_equal(there.theta, pb.simulate_ensemble("double", angles, times=[0.1]).theta)
    assert told[-1] == 30_000


def test_an_ensemble_does_not_wait_for_workers_that_never_come_back(monkeypatch):
    monkeypatch.setattr(chunks, "_PAUSE_S", 0.2)
    monkeypatch.setattr(connect, "_PATIENCE_S", 1.0)
    with made_cluster(1) as alone:
        angles = np.zeros((60_000, 2))
        with pytest.raises(InputError, match="its scheduler or all of its workers are gone"):
            pb.simulate_ensemble(
                "double", angles, times=[0.1], cluster=alone.scheduler_address, progress=lambda *_: alone.scale(0)
            )


def test_an_ensemble_whose_result_cannot_be_fetched_ends(address, monkeypatch):
    def fail(*_arguments, **_options):
        raise MemoryError("no room for it")

    monkeypatch.setattr(distributed.Client, "_gather_remote", fail)
    with pytest.raises(MemoryError, match="no room for it"):
        pb.simulate_ensemble("double", [[0.1, 0.2]], times=[0.1], cluster=address)


def test_an_ensemble_begins_although_its_workers_are_not_there_now(address, monkeypatch):
    monkeypatch.setattr(distributed.Client, "nthreads", lambda _: {})
    run = pb.simulate_ensemble("double", [[0.1, 0.2]], times=[0.1], cluster=address)
    assert run.status == ["ok"]


def test_who_is_not_there_to_answer_is_asked_again(address, monkeypatch):
    monkeypatch.setattr(connect, "_PAUSES_S", (0.0,))
    found, run = [], distributed.Client.run

    def run_later(*arguments):
        found.append(run(*arguments) if found else {})
        return found[-1]

    monkeypatch.setattr(distributed.Client, "run", run_later)
    with connect.connected(address, 1):
        assert [bool(answers) for answers in found] == [False, True]


def refusal(capsys, *options: str) -> str:
    """The one line that the command line says where it refuses."""
    assert main(["chaos", *options]) == 2
    out, said = capsys.readouterr()
    assert out == ""
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    return said


def test_without_dask_there_is_the_command_that_installs_it(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "distributed", None)
    for cluster in ("local", "tcp://127.0.0.1:8786"):
        assert refusal(capsys, "--cluster", cluster).endswith('pip install --upgrade "pendbench[dask]"\n')
        with pytest.raises(InputError, match="pip install"):
            pb.first_flips("double", [[0.1, 0.2]], cluster=cluster)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("where", ["tcp://127.0.0.1:1", "127.0.0.1:1", "nowhere", "foo://x:1", "tls://127.0.0.1:1"])
def test_a_cluster_that_is_not_there_is_one_line(where, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(connect, "_ANSWER_S", 3600.0)  # it does not take that long: who is refused knows it at once
    said = refusal(capsys, "--cluster", where, "--fresh")
    assert said.startswith(f"error: cluster '{where}' does not answer")
    assert "allowed: the address of a Dask scheduler" in said
    assert list(tmp_path.iterdir()) == []


def test_an_address_of_something_else_is_one_line(cluster, address, capsys, monkeypatch):
    monkeypatch.setattr(connect, "_ANSWER_S", 300.0)  # a worker that compiles is slow to answer
    worker = next(iter(cluster.workers.values())).worker_address
    assert "is a Worker of Dask" in refusal(capsys, "--cluster", worker)
    assert "cluster is ''" in refusal(capsys, "--cluster", "")
    assert "--jobs is 2; allowed: none" in refusal(capsys, "--cluster", address, "--jobs", "2")
    with pytest.raises(InputError, match="threads is 2; allowed: none"):
        pb.first_flips("double", [[0.1, 0.2]], cluster=address, threads=2)


def test_a_cluster_without_workers_is_one_line(monkeypatch):
    monkeypatch.setattr(connect, "_WORKERS_S", 0.1)
    with made_cluster(0) as empty, pytest.raises(InputError, match="has no workers; start one with: dask worker tcp"):
        DaskPool(empty.scheduler_address).__enter__()


def test_a_cluster_that_goes_away_is_one_line():
    made = made_cluster(1)
    gone = pytest.raises(InputError, match="are gone; what was finished is kept")
    with gone, DaskPool(made.scheduler_address) as pool:
        for _ in pool.run([job(does.nap, i, 0.02, key=str(i)) for i in range(10_000)]):
            made.close()


def test_dask_is_loaded_only_where_it_is_asked_for():
    line = "import sys, pendbench.commands.run; assert not {'dask', 'distributed'} & {*sys.modules}"
    subprocess.run([sys.executable, "-c", line], check=True)
