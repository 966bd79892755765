"""Runs the jobs of a study: what is already on disk is not run again, what finishes is on disk at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from pendbench.engines.protocol import Fault
from pendbench.study.jobs import Executor, Job
from pendbench.study.store import Store


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
    """Where jobs run and what they leave behind."""

    store: Store
    executor: Executor
    watcher: Watcher = field(default_factory=Silence)

    def run(
        self, stage: str, jobs: Sequence[Job], on_fault: Callable[[Job, Fault], Any], *, alone: bool = False
    ) -> dict[str, Any]:
        """The value of each job by its key. `on_fault` says what stands for a job that did not return; alone: one job
        at a time, for timings.

        Values are of JSON's types. What stands for a fault is not kept: a slow day, a full disk or too little memory
        should not stay on record, and a fault of the engine's own comes back the next time.
        """
        values = {job.key: value for job in jobs if (value := self.store.load(job.key)) is not None}
        waiting = [job for job in jobs if job.key not in values]
        self.watcher.begin(stage, len(jobs), len(values))
        for outcome in self.executor.run(waiting, alone=alone):
            if outcome.fault is None:
                self.store.save(outcome.job.key, outcome.value)
                values[outcome.job.key] = outcome.value
            else:
                values[outcome.job.key] = on_fault(outcome.job, outcome.fault)
            self.watcher.advance()
        return values


def distinct(jobs: Iterable[Job]) -> list[Job]:
    """The jobs without those whose key came before."""
    return list({job.key: job for job in jobs}.values())
