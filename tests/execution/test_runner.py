"""What is on disk is not run again, what finishes is on disk at once, and what failed is tried the next time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.base.source import source_digest
from pendbench.execution.pool import Outcome
from pendbench.execution.runner import Runner
from pendbench.execution.store import Store
from pendbench.execution.tasks import LostError, Needed, perform, task

FAULT = Fault("timed out", "took longer than 1 s")


@dataclass(frozen=True)
class Found:
    status: str
    reason: str = ""
    value: float = 0.0
    text: str = ""


def find(name: str) -> Found:
    return Found("ok", text=name)


def build(name: str, first: Found | None) -> Found:
    return Found("ok", text=f"{name} upon {first.text if first else 'nothing'}")


A, B, C = (task(find, name) for name in "abc")
UPON = task(build, "upon", needs=(A,))


class Scripted:
    """An executor: what it makes of each task is given, by the task; an exception among them is raised."""

    def __init__(self, *script) -> None:
        self.script, self.asked, self.jobs = list(script), [], []

    def run(self, jobs, *, alone=False):
        jobs = {job.key: job for job in jobs}
        self.asked.append(([*jobs], alone))
        self.jobs += jobs.values()
        for entry in self.script:
            if isinstance(entry, BaseException):
                raise entry
            done, value = entry
            if done.key not in jobs:  # it is kept from before
                continue
            fault = isinstance(value, Fault)
            yield Outcome(jobs[done.key], None if fault else value, value if fault else None)


class Here:
    """An executor that runs jobs in this process."""

    def run(self, jobs, *, alone=False):  # noqa: ARG002
        for job in jobs:
            yield Outcome(job, job.function(*job.arguments))


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path)


def run(store, executor, *tasks, **options):
    return Runner(store, executor).run("stage", {each: each for each in tasks}, **options)


def test_records_come_back_by_owner_and_stay(store):
    a, b, c = Found("ok", value=1.5), Found("ok", "so so", math.inf), Found("ok")
    first = Scripted((B, b), (A, a))
    assert run(store, first, A, B) == {A: a, B: b}
    assert first.asked == [([A.key, B.key], False)]
    second = Scripted((C, c))
    assert run(store, second, A, B, C, alone=True) == {A: a, B: b, C: c}
    assert second.asked == [([C.key], True)]


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), OSError("disk full")])
def test_what_finished_before_a_stop_is_kept(store, stop):
    a, b = Found("ok", text="a"), Found("ok", text="b")
    with pytest.raises(type(stop)):
        run(store, Scripted((A, a), stop), A, B)
    after = Scripted((B, b))
    assert run(store, after, A, B) == {A: a, B: b}
    assert after.asked == [([B.key], False)]


@pytest.mark.parametrize("status", ["timed out", "crashed", "out of memory", "error"])
def test_what_failed_is_a_record_and_is_tried_again_the_next_time(store, status):
    assert run(store, Scripted((A, Fault(status, "why"))), A) == {A: Found(status, "why")}
    a = Found("ok", text="a")
    assert run(store, Scripted((A, a)), A) == {A: a}


def test_a_run_without_enough_memory_is_a_record_and_is_tried_again_the_next_time(store):
    short, whole = Found("out of memory", "the limit is 1 GB", 1e-9), Found("ok")
    assert run(store, Scripted((A, short)), A) == {A: short}
    assert run(store, Scripted((A, whole)), A) == {A: whole}


def test_what_a_task_needs_is_handed_to_it(store):
    runner = Runner(store, Here())
    runner.run("first", {"a": A})
    assert runner.run("second", {"upon": UPON}) == {"upon": Found("ok", text="upon upon a")}


def test_what_builds_upon_a_task_that_failed_is_kept_apart(store):
    """As the comparison with a truth: without one it finds something else."""

    def study(first, *second):
        runner = Runner(store, Scripted())
        for tasks, script in (([A], [first]), ([UPON, B], second)):
            runner.executor.script = [*script]
            found = runner.run("stage", {each: each for each in tasks})
        return found, runner.executor.asked[1][0]

    without, whole, b = Found("ok", text="no truth"), Found("ok", text="compared"), Found("ok")
    for bad in (FAULT, Found("out of memory")):
        found, asked = study((A, bad), (UPON, without), (B, b))
        assert found == {UPON: without, B: b}
    assert asked == [], "it is kept, though"
    found, asked = study((A, Found("ok", text="a")), (UPON, whole))
    assert found == {UPON: whole, B: b}
    assert asked == [UPON.key]
    assert study((A, Found("ok", text="a")))[0] == found


def test_a_task_is_handed_none_for_what_was_not_found_and_fails_where_it_is_lost(store):
    """As on a network drive that shows a file late: what is found without it must not be kept as found with it."""
    assert perform(build, ("upon",), (None,), store, source_digest()).text == "upon upon nothing"
    with pytest.raises(LostError, match=A.key):
        perform(build, ("upon",), (Needed(A.key, Found),), store, source_digest())


def test_a_study_ends_where_the_project_is_edited_meanwhile(store, monkeypatch):
    """A worker that starts late has the new source, and its results belong to no key of the study's."""
    monkeypatch.setattr("pendbench.execution.tasks.source_digest", lambda: "edited")
    with pytest.raises(InputError, match="has changed since the study began; run the same line again"):
        run(store, Here(), A)
    assert store.load(A.key, Found) is None


def test_what_builds_upon_what_lacked_something_is_kept_apart(store):
    """A task whose need ended well, but without what that needed in its turn."""
    top = task(build, "top", needs=(UPON,))

    def study(a):
        runner = Runner(store, Scripted((A, a)))
        runner.run("first", {"a": A})
        for name, each in (("upon", UPON), ("top", top)):
            found = Runner(store, Here(), failed=runner.failed).run(name, {name: each})
        return found["top"].text

    assert study(FAULT) == "top upon upon upon nothing"
    assert study(Found("ok", text="a")) == "top upon upon upon a"


def test_every_job_has_the_limits_that_the_study_allows(store):
    executor = Scripted((A, Found("ok")))
    tasks = {"once": A, "four times": task(find, "long", share=4.0)}
    executor.script.append((tasks["four times"], Found("ok")))
    Runner(store, executor, time_limit=3.0, memory_limit=2.5).run("stage", tasks)
    assert [(job.time_limit, job.memory_limit) for job in executor.jobs] == [(3.0, 2.5), (12.0, 2.5)]


def test_a_watcher_hears_of_every_job(store):
    heard = []

    class Watcher:
        def begin(self, stage, total, done):
            heard.append((stage, total, done))

        def advance(self):
            heard.append("one")

    store.save(A.key, Found("ok"))
    outcomes = Scripted((B, Found("ok")), (C, FAULT))
    Runner(store, outcomes, Watcher()).run("stage", {each: each for each in (A, B, C)})
    assert heard == [("stage", 3, 1), "one", "one"]


def test_what_two_ask_for_runs_once(store):
    executor = Scripted((A, Found("ok")))
    found = Runner(store, executor).run("stage", {"one": A, "other": task(find, "a")})
    assert found == {"one": Found("ok"), "other": Found("ok")}
    assert executor.asked == [([A.key], False)]


@dataclass(frozen=True, eq=False)
class WithArrays:
    status: str
    reason: str = ""
    values: FloatArray | None = None


def test_arrays_travel_from_one_task_to_another(store):
    runner = Runner(store, Here())
    made = task(fill, 3)
    runner.run("first", {0: made})
    assert runner.run("second", {0: task(add, needs=(made,))})[0].value == 3.0


def fill(count: int) -> WithArrays:
    return WithArrays("ok", values=np.ones(count))


def add(filled: WithArrays | None) -> Found:
    return Found("ok", value=float(filled.values.sum()))
