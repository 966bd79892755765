"""Jobs run in processes of their own, and whatever becomes of one, the others go on."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pebble.pool.process
import pytest
from pebble import CONSTS

from pendbench.base.errors import InputError
from pendbench.execution.pool import Job, LocalPool, Outcome
from support import job_functions as does
from support.processes import assert_gone

WORKERS = 2


@pytest.fixture(scope="module", autouse=True)
def _workers_find_the_functions():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(Path(__file__).parents[1]), prepend=os.pathsep)
        yield


@pytest.fixture(scope="module")
def pool():
    """One pool for most tests: they also show that a job leaves it fit for those after it."""
    with LocalPool(WORKERS) as made:
        yield made


def job(function, *arguments, key: str = "", limit: float = 60.0, **limits: float) -> Job:
    return Job(key or function.__name__, function, arguments, limit, **limits)


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


def test_arithmetic_takes_one_thread_unless_the_user_wants_more(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setenv("MKL_NUM_THREADS", "2")
    with LocalPool(1) as pool:
        (outcome,) = outcomes(pool, job(does.threads_of_arithmetic)).values()
        assert (os.environ["OPENBLAS_NUM_THREADS"], os.environ["MKL_NUM_THREADS"]) == ("1", "2")
    told, beside = outcome.value
    assert told == "1"
    assert beside < 0.2  # 0.5 with two threads
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_workers_have_the_variables_and_the_folder_of_their_pool(tmp_path, monkeypatch):
    """And not those of an earlier one."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        monkeypatch.setenv("OF_A_TEST", name)
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / name))
        monkeypatch.chdir(tmp_path / name)
        with LocalPool(1) as pool:
            (outcome,) = outcomes(pool, job(does.surroundings, "OF_A_TEST")).values()
        assert outcome.value == (name, str(tmp_path / name), str(tmp_path / name / "pendbench"))
        monkeypatch.delenv("OF_A_TEST")
    with LocalPool(1) as pool:
        assert outcomes(pool, job(does.surroundings, "OF_A_TEST"))["surroundings"].value[0] is None


def test_a_pool_that_cannot_start_leaves_nothing_in_the_environment(monkeypatch):
    def refuses(**_: object) -> None:
        raise OSError("no more processes")

    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setattr("pebble.ProcessPool", refuses)
    with pytest.raises(OSError, match="no more") as failed, LocalPool(1):
        pass
    assert "OPENBLAS_NUM_THREADS" not in os.environ
    del failed  # until here it holds what the pool had begun: nothing was tidied up by chance


def test_where_not_all_processes_can_be_started_that_is_one_line_and_none_stays(monkeypatch):
    started, launch = [], pebble.pool.process.launch_process

    def launch_one(*arguments: object) -> object:
        if started:
            raise OSError(11, "Resource temporarily unavailable")
        started.append(launch(*arguments))
        return started[0]

    monkeypatch.setattr(pebble.pool.process, "launch_process", launch_one)
    told = r"^worker processes cannot be started: .*temporarily unavailable$"
    with pytest.raises(InputError, match=told), LocalPool(WORKERS):
        pass
    assert_gone(started[0].pid)


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
    slow = [job(function, 3600.0, wall_limit=2.0) for function in (does.sleep, does.sleep_deaf)]
    slow += [job(function, limit=0.5) for function in (does.spin, does.spin_compiled)]
    good = [job(does.identity, i, key=f"good {i}") for i in range(len(bad))]
    with LocalPool(WORKERS) as pool:
        found = outcomes(pool, *(each for pair in zip(bad, good, strict=True) for each in pair), *slow)
    for name, (_, status, reason) in FAULTS.items():
        assert found[name].fault.status == status, name
        assert reason in found[name].fault.reason, name
        assert found[name].value is None
        assert "\n" not in found[name].fault.reason
    for name in ("sleep", "sleep_deaf"):
        assert found[name].fault == ("timed out", "took longer than 2 s by the clock")
    for name in ("spin", "spin_compiled"):
        assert found[name].fault == ("timed out", "took longer than 0.5 s of processor time")
    assert [found[f"good {i}"].value for i in range(len(bad))] == list(range(len(bad)))
    assert capfd.readouterr() == ("", "")  # nobody has to read what a worker thinks of it


def test_only_the_processor_time_of_the_work_itself_counts(pool):
    found = outcomes(
        pool,
        job(does.sleep, 1.5, limit=0.5),
        job(does.compile_for, 1.5, limit=0.5),
        job(does.prepare_and_work, 0.5, 0.0, limit=0.5),
    )
    assert not [outcome.fault for outcome in found.values() if outcome.fault]
    assert found["compile_for"].value > 1.5


def test_what_is_used_between_times_that_do_not_count_is_added_up(pool):
    found = outcomes(pool, job(does.prepare_and_work, 0.1, 0.3, limit=1.0))
    assert found["prepare_and_work"].fault == ("timed out", "took longer than 1 s of processor time")


def test_each_job_has_its_own_time():
    with LocalPool(1) as pool:
        assert {outcome.value for outcome in pool.run([job(does.spin, 0.3, limit=0.5)] * 4)} == {"done"}


def test_the_limit_by_the_clock_is_far_beyond_that_of_processor_time():
    assert job(does.spin, limit=5.0).hangs_after == 600.0
    assert job(does.spin, limit=100.0).hangs_after == 2000.0


LINUX = pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux only")


@LINUX
def test_a_job_that_takes_too_much_memory_is_an_outcome_and_the_next_one_has_its_own_share(pool):
    jobs = [job(does.take, 20.0, key=f"much {i}", memory_limit=0.6) for i in range(2 * WORKERS)]
    jobs += [job(does.take, 0.5, key=f"little {i}", memory_limit=0.6) for i in range(2 * WORKERS)]
    jobs.append(job(does.take_or_abort, 20.0, key="aborts", memory_limit=0.6))
    jobs.append(job(does.record_of_exhaustion, key="tells", memory_limit=0.6))
    found = outcomes(pool, *jobs)
    for i in range(2 * WORKERS):
        status, reason = found[f"much {i}"].fault
        assert status == "out of memory"
        assert "MemoryError: Unable to allocate 95.4 MiB" in reason
        assert reason.endswith("; the limit is 0.6 GB")
        assert found[f"little {i}"].value == 5
    reason = "the process died of SIGABRT, perhaps for want of memory; the limit is 0.6 GB"
    assert found["aborts"].fault == ("crashed", reason)
    assert found["tells"].value == does.Record("out of memory", "MemoryError; the limit is 0.6 GB")


def test_without_a_limit_of_memory_there_is_none(pool):
    found = outcomes(pool, job(does.take, 3.0), job(does.exhaust), job(does.record_of_exhaustion))
    assert found["take"].value == 30
    assert found["exhaust"].fault.reason == "MemoryError"
    assert found["record_of_exhaustion"].value == does.record_of_exhaustion()


@LINUX
def test_address_space_is_not_memory(pool):
    assert outcomes(pool, job(does.reserve, 20.0, memory_limit=0.6))["reserve"].value == "reserved"
    assert outcomes(pool, job(does.take, 3.0))["take"].value == 30, "the limit ends with its job"


@LINUX
def test_what_jobs_leave_behind_is_no_burden_on_others_and_does_not_grow_for_ever():
    with LocalPool(1) as pool:
        kept = [job(does.take_and_keep, 0.4, key=str(i), memory_limit=0.6) for i in range(5)]
        pids = [outcome.value for outcome in pool.run(kept, alone=True)]
    assert None not in pids
    assert pids[0] == pids[1], "less than the limit is left behind: the worker goes on"
    assert len(set(pids)) == 3


def test_a_job_that_leaves_as_a_used_up_worker_does_is_not_tried_for_ever(pool):
    assert outcomes(pool, job(does.leave_used_up))["leave_used_up"].fault.status == "crashed"


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


def test_stopping_many_workers_takes_no_longer_than_stopping_one():
    with pytest.raises(KeyboardInterrupt), LocalPool(3) as pool:  # noqa: PT012
        next(pool.run([job(os.getpid), *(job(does.sleep_deaf, 600.0, key=str(i)) for i in range(3))]))
        raise KeyboardInterrupt
    assert CONSTS.term_timeout * 3 <= 0.5  # s to each, one after the other


def test_workers_end_with_the_process_that_started_them(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent("""
            import os, signal, time
            from pendbench.execution.pool import Job, LocalPool
            if __name__ == "__main__":
                with LocalPool(1) as pool:
                    found = pool.run([Job("a", os.getpid, (), 60.0), Job("b", time.sleep, (3600.0,), 3600.0)])
                    print(next(found).value, flush=True)
                    time.sleep(1.0)  # so that the other one has begun
                    os.kill(os.getpid(), signal.SIGKILL)
        """)
    )
    ran = subprocess.run([sys.executable, str(script)], stdout=subprocess.PIPE, check=False)
    assert ran.returncode == -signal.SIGKILL
    assert_gone(int(ran.stdout))


def test_a_job_is_packed_before_it_is_sent(pool):
    with pytest.raises((pickle.PicklingError, AttributeError)):
        outcomes(pool, job(lambda: None, key="no name to find it by"))
    assert outcomes(pool, job(does.identity, 1))["identity"].value == 1


def test_a_worker_that_is_still_starting_as_the_pool_ends_says_nothing(capfd, monkeypatch):
    stop = pebble.pool.process.stop_process

    def stop_late(worker):
        time.sleep(1.5)  # by then it has looked for what it shares with the others
        stop(worker)

    monkeypatch.setattr(pebble.pool.process, "stop_process", stop_late)
    with LocalPool(WORKERS):
        pass
    assert capfd.readouterr() == ("", "")


UNGUARDED = {
    "pool": """
        from pendbench.execution.pool import LocalPool
        with LocalPool(1):
            print("goes on")
    """,
    "study": """
        import pendbench
        try:
            pendbench.run_study("chaos", quick=True)
        except pendbench.InputError:
            print("goes on")
    """,
    "ensemble": """
        import pendbench
        def run():
            pendbench.simulate_ensemble("double", [[0.1, 0.2]], cluster="local", threads=1)
        run()
    """,
}
TOLD = 'error: a script that runs a study needs the line `if __name__ == "__main__":` before it'


def ran_as_script(folder: Path, text: str) -> subprocess.CompletedProcess:
    script = folder / "script.py"
    script.write_text(textwrap.dedent(text))
    return subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False, cwd=folder)


@pytest.mark.parametrize("name", UNGUARDED)
def test_a_script_without_a_guard_is_told_so_in_one_line(tmp_path, name):
    ran = ran_as_script(tmp_path, UNGUARDED[name])
    assert (ran.returncode, ran.stdout, ran.stderr) == (1, "", f"{TOLD}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["script.py"]


def test_where_a_guard_cannot_be_told_from_none_the_workers_refuse(tmp_path):
    text = """
        from pendbench import InputError
        from pendbench.execution.pool import Job, LocalPool
        import os
        try:
            print("not __main__" if __name__ == "main" else "")
            with LocalPool(1) as pool:
                list(pool.run([Job("a", os.getpid, (), 60.0), Job("b", os.getpid, (), 60.0)]))
        except InputError as error:
            print("told:", error)
    """
    ran = ran_as_script(tmp_path, text)
    assert ran.returncode == 0, ran.stderr
    assert "told: the worker processes died as they started" in ran.stdout
    assert TOLD in ran.stderr
    assert "Traceback" not in ran.stderr


KILLED = """
import os, signal
from pendbench.execution.pool import LocalPool

if __name__ == "__main__":
    with LocalPool(1):
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_nothing_is_left_to_say_of_a_study_that_was_killed(tmp_path):
    """What tidies up after it does so: the error stream is open until that, too, has ended."""
    (tmp_path / "study.py").write_text(KILLED)
    ran = subprocess.run([sys.executable, str(tmp_path / "study.py")], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (-signal.SIGKILL, "")
