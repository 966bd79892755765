"""Runs the tasks of a study: what is already on disk is not run again, what finishes is on disk at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, cast

from pendbench.base.source import source_digest
from pendbench.execution.content import key_of
from pendbench.execution.limits import TIME_LIMIT_S
from pendbench.execution.pool import OUT_OF_MEMORY, Executor, Job, Outcome
from pendbench.execution.store import Store
from pendbench.execution.tasks import Needed, Task, perform

Owner = TypeVar("Owner")
R = TypeVar("R", bound="Record")


class Record(Protocol):
    """What a task finds. Its class can be made of a status and a reason alone: that stands for a task that failed."""

    @property
    def status(self) -> str:
        """How it went, one of `faults.STATUSES`."""

    @property
    def reason(self) -> str:
        """Why, where it did not go well."""


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
    """Where tasks run and what they leave behind.

    time_limit, memory_limit: s and GB for each task. failed: the keys of tasks of which nothing was kept. kept: how
    many results of each stage were there from before, and how many it has.
    """

    store: Store
    executor: Executor
    watcher: Watcher = field(default_factory=Silence)
    time_limit: float = TIME_LIMIT_S
    memory_limit: float | None = None
    failed: set[str] = field(default_factory=set)
    kept: list[tuple[int, int]] = field(default_factory=list)

    def run(self, stage: str, tasks: Mapping[Owner, Task[R]], *, alone: bool = False) -> dict[Owner, R]:
        """What each task found, by its owner; where one did not return, a record of nothing but status and reason.

        alone: one task at a time, for timings. What stands for a fault is not kept: a slow day, a full disk or too
        little memory should not stay on record, and a fault of the engine's own comes back the next time.
        """
        distinct = {task.key: task for task in tasks.values()}
        found: dict[str, R] = {}
        for key, task in distinct.items():
            if (kept := self.store.load(self._kept_as(task), task.result)) is not None:
                found[key] = kept
        self.kept.append((len(found), len(distinct)))
        self.watcher.begin(stage, len(distinct), len(found))
        jobs = [self._job(task) for key, task in distinct.items() if key not in found]
        for outcome in self.executor.run(jobs, alone=alone):
            task = distinct[outcome.job.key]
            found[task.key] = self._kept(task, outcome)
            self.watcher.advance()
        return {owner: found[task.key] for owner, task in tasks.items()}

    def _job(self, task: Task[Any]) -> Job:
        needed = tuple(
            None if need.key in self.failed else Needed(self._kept_as(need), need.result) for need in task.needs
        )
        arguments = (task.function, task.arguments, needed, self.store, source_digest())
        return Job(task.key, perform, arguments, task.share * self.time_limit, self.memory_limit)

    def _kept(self, task: Task[R], outcome: Outcome) -> R:
        """What a task found, and on disk where it found something."""
        made = cast(Callable[..., R], task.result)
        found: R = outcome.value if outcome.fault is None else made(*outcome.fault)
        if outcome.fault is None and found.status != OUT_OF_MEMORY:
            self.store.save(self._kept_as(task), found)
        else:
            self.failed.add(task.key)
        return found

    def _kept_as(self, task: Task[Any]) -> str:
        """The key under which a result is kept: another one where what it needs has failed, or lacked something itself.

        What was found without the truth, say, is not taken for what is found with it.
        """
        lacking = [need.key for need in task.needs if need.key in self.failed or self._kept_as(need) != need.key]
        return key_of(task.function, task.key, lacking) if lacking else task.key
