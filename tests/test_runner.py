"""What is on disk is not run again, what finishes is on disk at once, and what failed is tried the next time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pendbench.engines.protocol import Fault
from pendbench.study.jobs import Job, Outcome
from pendbench.study.runner import Runner, distinct
from pendbench.study.store import Store, key_of

A, B, C = (Job(key_of(name), str, (name,), 1.0) for name in "abc")
FAULT = Fault("timed out", "took longer than 1 s")


class Scripted:
    """An executor whose outcomes are given; an exception among them is raised."""

    def __init__(self, *script) -> None:
        self.script, self.asked = list(script), []

    def run(self, jobs, *, alone=False):
        self.asked.append(([*jobs], alone))
        for outcome in self.script:
            if isinstance(outcome, BaseException):
                raise outcome
            yield outcome


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path)


def run(store, executor, jobs, **options):
    return Runner(store, executor).run("stage", jobs, lambda job, fault: [job.key, fault.status], **options)


def test_values_come_back_by_key_and_stay(store):
    first = Scripted(Outcome(B, {"b": 1.5}), Outcome(A, [1, 2]))
    assert run(store, first, [A, B]) == {A.key: [1, 2], B.key: {"b": 1.5}}
    assert first.asked == [([A, B], False)]
    second = Scripted(Outcome(C, "c"))
    assert run(store, second, [A, B, C], alone=True) == {A.key: [1, 2], B.key: {"b": 1.5}, C.key: "c"}
    assert second.asked == [([C], True)]


@pytest.mark.parametrize("stop", [KeyboardInterrupt(), OSError("disk full")])
def test_what_finished_before_a_stop_is_kept(store, stop):
    with pytest.raises(type(stop)):
        run(store, Scripted(Outcome(A, "a"), stop), [A, B])
    assert store.load(A.key) == "a"
    after = Scripted(Outcome(B, "b"))
    assert run(store, after, [A, B]) == {A.key: "a", B.key: "b"}
    assert after.asked == [([B], False)]


@pytest.mark.parametrize("status", ["timed out", "crashed", "out of memory", "error"])
def test_what_failed_is_tried_again_the_next_time(store, status):
    assert run(store, Scripted(Outcome(A, fault=Fault(status, ""))), [A]) == {A.key: [A.key, status]}
    assert store.load(A.key) is None
    assert run(store, Scripted(Outcome(A, "a")), [A]) == {A.key: "a"}


def test_a_run_without_enough_memory_is_a_value_and_is_tried_again_the_next_time(store):
    short = {"status": "out of memory", "reason": "MemoryError; the limit is 1 GB", "error_max": 1e-9}
    assert run(store, Scripted(Outcome(A, short)), [A]) == {A.key: short}
    assert run(store, Scripted(Outcome(A, {"status": "ok"})), [A]) == {A.key: {"status": "ok"}}


def test_what_builds_upon_a_job_that_failed_is_kept_apart(store):
    """As the comparison with a truth: without one it has another value, and the same key."""
    upon = Job(key_of("upon"), str, (1, A.key), 1.0)

    def study(first: Outcome, *second: Outcome):
        runner = Runner(store, Scripted())
        for stage, script in (([A], [first]), ([upon, B], second)):
            runner.executor.script = [*script]
            found = runner.run("stage", stage, lambda *_: None)
        return found, runner.executor.asked[1][0]

    without, whole = Outcome(upon, "no truth"), Outcome(upon, "compared")
    failed = Outcome(A, fault=FAULT)
    for bad in (failed, Outcome(A, {"status": "out of memory"})):
        found, asked = study(bad, without, Outcome(B, "b"))
        assert found == {upon.key: "no truth", B.key: "b"}
    assert asked == [], "it is kept, though"
    found, asked = study(Outcome(A, "a"), whole)
    assert found == {upon.key: "compared", B.key: "b"}
    assert asked == [upon]
    assert study(Outcome(A, "a"))[0] == found


def test_every_job_has_the_memory_that_the_study_allows(store):
    executor = Scripted(Outcome(A, "a"))
    Runner(store, executor, memory_limit=2.5).run("stage", [A], lambda *_: None)
    assert executor.asked == [([replace(A, memory_limit=2.5)], False)]


def test_a_watcher_hears_of_every_job(store):
    heard = []

    class Watcher:
        def begin(self, stage, total, done):
            heard.append((stage, total, done))

        def advance(self):
            heard.append("one")

    store.save(A.key, "a")
    outcomes = Scripted(Outcome(B, "b"), Outcome(C, fault=FAULT))
    Runner(store, outcomes, Watcher()).run("stage", [A, B, C], lambda *_: None)
    assert heard == [("stage", 3, 1), "one", "one"]


def test_a_job_that_is_asked_for_twice_runs_once():
    again = Job(A.key, str, ("other",), 2.0)
    assert [job.key for job in distinct([A, B, again, C, B])] == [A.key, B.key, C.key]
