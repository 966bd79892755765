"""Runs the jobs of a study: what is already on disk is not run again, what finishes is on disk at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from pendbench.engines.protocol import Fault
from pendbench.study.jobs import OUT_OF_MEMORY, Executor, Job
from pendbench.study.store import Store, key_of


class Watcher(Protocol):
    """Is told how far a study is."""

    def begin(self, stage: str, total: int, done: int) -> None:
        """A stage of `total` jobs begins, `done` of them found on disk."""

    def advance(self) -> None:
        """One more job of the stage is done."""


class Silence:
    """Watches, and says nothing."""

    def begin(self, stage: str, total: int, done: int) -> None:
        """Say nothing."""

    def advance(self) -> None:
        """Say nothing."""


@dataclass(frozen=True)
class Runner:
    """Where jobs run and what they leave behind.

    memory_limit: GB for each job. failed: the keys of jobs of which nothing was kept.
    """

    store: Store
    executor: Executor
    watcher: Watcher = field(default_factory=Silence)
    memory_limit: float | None = None
    failed: set[str] = field(default_factory=set)

    def run(
        self, stage: str, jobs: Sequence[Job], on_fault: Callable[[Job, Fault], Any], *, alone: bool = False
    ) -> dict[str, Any]:
        """The value of each job by its key. `on_fault` says what stands for a job that did not return; alone: one job
        at a time, for timings.

        Values are of JSON's types. What stands for a fault is not kept: a slow day, a full disk or too little memory
        should not stay on record, and a fault of the engine's own comes back the next time.
        """
        values = {job.key: value for job in jobs if (value := self.store.load(self._kept_as(job))) is not None}
        waiting = [replace(job, memory_limit=self.memory_limit) for job in jobs if job.key not in values]
        self.watcher.begin(stage, len(jobs), len(values))
        for outcome in self.executor.run(waiting, alone=alone):
            job, fault = outcome.job, outcome.fault
            values[job.key] = outcome.value if fault is None else on_fault(job, fault)
            if fault is None and not _lacked_memory(outcome.value):
                self.store.save(self._kept_as(job), outcome.value)
            else:
                self.failed.add(job.key)
            self.watcher.advance()
        return values

    def _kept_as(self, job: Job) -> str:
        """The key under which a job's value is kept: another one where a job that it builds upon has failed.

        What was found without the truth, say, is not taken for what is found with it.
        """
        lacking = [part for part in job.arguments if isinstance(part, str) and part in self.failed]
        return key_of(job.key, *lacking) if lacking else job.key


def _lacked_memory(value: Any) -> bool:
    return isinstance(value, dict) and value.get("status") == OUT_OF_MEMORY


def distinct(jobs: Iterable[Job]) -> list[Job]:
    """The jobs without those whose key came before."""
    return list({job.key: job for job in jobs}.values())
