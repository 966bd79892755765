"""Jobs run in processes of their own, and whatever becomes of one, the others go on."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import job_functions as does
from pendbench.errors import InputError
from pendbench.study.jobs import Job, LocalPool, Outcome

WORKERS = 2


@pytest.fixture(scope="module", autouse=True)
def _workers_find_the_functions():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
        yield


@pytest.fixture(scope="module")
def pool():
    """One pool for most tests: they also show that a job leaves it fit for those after it."""
    with LocalPool(WORKERS) as made:
        yield made


def job(function, *arguments, key: str = "", limit: float = 60.0) -> Job:
    return Job(key or function.__name__, function, arguments, limit)


def outcomes(pool, *jobs: Job, alone: bool = False) -> dict[str, Outcome]:
    found = list(pool.run(jobs, alone=alone))
    assert len(found) == len(jobs)
    return {outcome.job.key: outcome for outcome in found}


def test_jobs_run_in_other_processes(pool):
    found = outcomes(pool, *(job(does.process, key=str(i)) for i in range(20)))
    pids = {outcome.value[0] for outcome in found.values()}
    assert os.getpid() not in pids
    assert 1 <= len(pids) <= WORKERS
    assert {outcome.value[1] for outcome in found.values()} == {os.getpid()}


def test_as_many_run_at_once_as_there_are_workers(pool, tmp_path):
    # Each waits for the other: run one after the other, both would time out.
    found = outcomes(pool, *(job(does.meet, str(tmp_path), key, 1, key=key) for key in "ab"))
    assert [found[key].value for key in "ab"] == [1, 1]


def test_no_jobs_have_no_outcomes(pool):
    assert outcomes(pool) == {}


def test_every_job_comes_back_with_its_own_value(pool):
    values = [None, 0, "text", {"a": [1.5, float("inf")]}, b"\x00", [], ("tuple",), "x" * 3_000_000]
    found = outcomes(pool, *(job(does.identity, value, key=str(i)) for i, value in enumerate(values)))
    assert [found[str(i)].value for i in range(len(values))] == values
    assert all(outcome.fault is None for outcome in found.values())


FAULTS = {
    "raises": (does.fail, "error", "ValueError: first line"),
    "raises what no pickle brings back": (does.fail_awkwardly, "error", "AwkwardError: one two"),
    "raises a time-out of its own": (does.time_out_by_itself, "error", "TimeoutError: the other side did not answer"),
    "runs out of memory": (does.exhaust, "out of memory", "MemoryError"),
    "leaves": (does.leave, "error", "SystemExit: done"),
    "leaves at once": (does.leave_at_once, "crashed", "the process died with exit code 7"),
    "kills itself": (does.kill_itself, "crashed", "the process died of SIGKILL"),
    "returns a lambda": (does.unpicklable, "error", "locals"),
    "returns a local class": (does.unpicklable_here, "error", "locals"),
}


def test_whatever_becomes_of_a_job_is_an_outcome_and_the_others_go_on(capfd):
    bad = [job(function, key=name) for name, (function, _, _) in FAULTS.items()]
    slow = [job(does.sleep, 600.0, key="sleeps", limit=0.5), job(does.sleep_deaf, 600.0, key="sleeps deaf", limit=0.5)]
    good = [job(does.identity, i, key=f"good {i}") for i in range(len(bad))]
    with LocalPool(WORKERS) as pool:
        found = outcomes(pool, *(each for pair in zip(bad, good, strict=True) for each in pair), *slow)
    for name, (_, status, reason) in FAULTS.items():
        assert found[name].fault.status == status, name
        assert reason in found[name].fault.reason, name
        assert found[name].value is None
        assert "\n" not in found[name].fault.reason
    for name in ("sleeps", "sleeps deaf"):
        assert found[name].fault == ("timed out", "took longer than 0.5 s")
    assert [found[f"good {i}"].value for i in range(len(bad))] == list(range(len(bad)))
    assert capfd.readouterr() == ("", "")  # nobody has to read what a worker thinks of it


def test_a_function_that_workers_cannot_find_is_an_outcome(pool, monkeypatch):
    monkeypatch.setattr(does, "only_here", does.identity, raising=False)
    function = type(does.identity)(does.identity.__code__, vars(does), "only_here")
    function.__qualname__ = "only_here"
    monkeypatch.setattr(does, "only_here", function)
    found = outcomes(pool, job(function, 1, key="bad"), job(does.identity, 1, key="good"))
    assert found["bad"].fault.status == "error"
    assert "only_here" in found["bad"].fault.reason
    assert found["good"].value == 1


def test_a_job_can_print_as_much_as_it_likes(capfd):
    with LocalPool(WORKERS) as pool:
        found = outcomes(pool, job(does.print_much, key="a"), job(does.print_much, key="b"))
    assert [found[key].value for key in "ab"] == [1_000_000] * 2
    printed = capfd.readouterr().out.count("x")
    assert printed == 2_000_000


def test_an_interrupt_is_for_the_main_process_alone(pool):
    assert outcomes(pool, job(does.interrupt_group))["interrupt_group"].value == "went on"


def test_alone_means_one_at_a_time(pool, tmp_path):
    jobs = [job(does.stay, str(tmp_path), str(i), key=str(i)) for i in range(4)]
    assert [outcome.value for outcome in pool.run(jobs, alone=True)] == [[]] * 4
    (tmp_path / "somebody").touch()
    assert outcomes(pool, jobs[0])["0"].value == ["somebody"], "the job sees nobody, whoever is there"


def test_alone_keeps_the_order(pool):
    jobs = [job(does.identity, i, key=str(i)) for i in range(6)]
    assert [outcome.value for outcome in pool.run(jobs, alone=True)] == list(range(6))


def test_jobs_are_taken_from_the_queue_as_there_is_room(pool):
    taken = []

    def endless():
        for i in range(10_000):
            taken.append(i)
            yield job(does.identity, i, key=str(i))

    found = pool.run(endless())
    next(found)
    assert len(taken) <= 2 * WORKERS
    found.close()


def test_bad_input_found_by_a_job_is_bad_input(pool):
    with pytest.raises(InputError, match=r"^dt is 0; allowed: above 0$"):
        outcomes(pool, job(does.refuse))


def test_an_error_ends_the_pool_at_once_and_its_processes_with_it():
    with pytest.raises(KeyboardInterrupt), LocalPool(1) as pool:  # noqa: PT012
        pid = next(pool.run([job(os.getpid)])).value
        unfinished = pool.run([job(os.getpid, key="a"), job(signal.pause, key="hangs"), job(os.getpid, key="b")])
        next(unfinished)
        raise KeyboardInterrupt
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_a_job_is_packed_before_it_is_sent(pool):
    with pytest.raises((pickle.PicklingError, AttributeError)):
        outcomes(pool, job(lambda: None, key="no name to find it by"))
    assert outcomes(pool, job(does.identity, 1))["identity"].value == 1


def test_a_script_without_a_guard_is_told_so(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent("""
            from pendbench import InputError
            from pendbench.study.jobs import Job, LocalPool
            import os
            try:
                with LocalPool(1) as pool:
                    list(pool.run([Job("a", os.getpid, (), 60.0), Job("b", os.getpid, (), 60.0)]))
            except InputError as error:
                print("told:", error)
        """)
    )
    ran = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 0, ran.stderr
    assert "told: the worker processes died as they started" in ran.stdout
    assert 'needs the line `if __name__ == "__main__":`' in ran.stderr
    assert "Traceback" not in ran.stderr
