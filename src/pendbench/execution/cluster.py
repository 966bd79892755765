"""Jobs on the machines of a Dask cluster: the interface, the limits and the outcomes of the local pool.

Who runs what, and what happens to the tasks of a worker that dies, is left to Dask. Jobs travel in batches, each a
task that is worth its overhead.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, suppress
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self

from pendbench.base.errors import InputError, describe
from pendbench.base.faults import Fault
from pendbench.base.processes import processor
from pendbench.base.source import source_digest
from pendbench.execution.connect import Patience, asked_again, connected, lost
from pendbench.execution.content import key_of
from pendbench.execution.pool import Job, Outcome
from pendbench.execution.store import Store

if TYPE_CHECKING:
    from pendbench.execution.cluster_worker import Ran

_WORTH_S: Final = 0.2  # what a task should take; handing one out takes some milliseconds
_MOST: Final = 1000
_PAUSE_S: Final = 2.0
#: What Dask says of a task that has not come to its end. Lost: it had, but with a worker that died; it is run again.
_UNDER_WAY: Final = {"pending", "lost"}

Batch = list[Job]


class Batches:
    """Cuts a queue of jobs into batches that take about `_WORTH_S`: single jobs first, then by what those took."""

    def __init__(self, jobs: Iterable[Job], most: int = _MOST, size: int = 1) -> None:
        self._queue, self._most, self._size = iter(jobs), most, min(size, most)

    def take(self) -> Batch:
        """The next batch; an empty one at the end."""
        return list(itertools.islice(self._queue, self._size))

    def give_back(self, jobs: Batch) -> None:
        """Jobs that nobody got to: they come first now."""
        self._queue = itertools.chain(jobs, self._queue)

    def learn(self, count: int, seconds: float) -> None:
        """So many jobs took so long together. At most twice as many go together next time: others may be slower."""
        worth = int(count * _WORTH_S / max(seconds, 1e-6))
        self._size = max(1, min(worth, 2 * self._size, self._most))


class DaskPool:
    """Workers of a Dask cluster, from `with` to its end.

    cluster: an address, or `local` for one of so many `workers` on this machine. store: what the jobs share, if
    anything; that every worker sees it is made sure of.
    """

    def __init__(self, cluster: str, workers: int = 1, store: Store | None = None) -> None:
        self.cluster, self.workers, self._store = cluster, workers, store
        self._timer = ""

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._client = stack.enter_context(connected(self.cluster, self.workers))
            self._name = f"pendbench-{self._client.id}"
            self._prepare(stack)
            self._ends = stack.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._ends.__exit__(kind, error, at)

    def _prepare(self, stack: ExitStack) -> None:
        """Give each worker its pool; raise InputError where one cannot do its work."""
        from pendbench.execution.cluster_worker import Host, flaw_of

        client = self._client
        token = key_of(connected, self._name)
        if self._store is not None:
            self._store.save(token, token)
            stack.callback(self._store.forget, token)
        try:
            stack.callback(self._leave)
            asked_again(lambda: client.register_plugin(Host(self._name, source_digest(), self._store, token)))
            flaws = asked_again(lambda: client.run(flaw_of, self._name))
            processor_name = asked_again(self._ask_processor)
        except Exception as error:  # whatever keeps a worker from loading what it needs
            raise InputError(f"cluster {self.cluster!r}: a worker cannot run pendbench ({describe(error)})") from None
        if found := sorted(filter(None, flaws.values())):
            raise InputError(f"cluster {self.cluster!r}: {found[0]}")
        self.workers = max(1, sum(client.nthreads().values()))
        self.facts = {"cluster": self.cluster, "processor": processor_name}

    def _ask_processor(self) -> str:
        """The processor's name, of the worker that times. Raises ConnectionError where there is none for now."""
        if not (worker := self._timing_worker()):
            raise ConnectionError("no worker is left")
        name: str = self._client.run(processor, workers=[worker])[worker]
        return name

    def _leave(self) -> None:
        """Take the pools away again, where there still is a cluster; a worker that dies meanwhile has none left."""
        if self._client.status == "running":
            with suppress(OSError, LookupError, ValueError):
                self._client.unregister_worker_plugin(self._name)

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        """The outcome of each job, in the order in which they finish. alone: one at a time, all by the same worker.

        Jobs whose workers died again and again are tried once more, each by itself, to tell the one that kills from
        those that were beside it. Raises InputError for a job that does, and where the cluster is lost.
        """
        suspects: Batch = []
        yield from self._run(jobs, suspects, 1 if alone else 2 * self.workers, timed=alone)
        for job in suspects:
            guilty: Batch = []
            yield from self._run([job], guilty, 1)
            for each in guilty:
                yield Outcome(each, fault=Fault("crashed", "the workers that ran it died, one after the other"))

    def _run(self, jobs: Iterable[Job], killed: Batch, room: int, *, timed: bool = False) -> Iterator[Outcome]:
        batches = Batches(jobs, 1 if timed else _MOST)
        tasks = _Tasks(self._client, self._name, self.cluster)
        try:
            while True:
                while len(tasks) < room and (batch := batches.take()):
                    tasks.send(batch, self._timing_worker() if timed else None)
                if not len(tasks):
                    return
                batch, ran = tasks.next()
                if ran is None:
                    killed += batch
                    continue
                done = len(ran.results)
                batches.give_back(batch[done:])
                batches.learn(done, ran.seconds)
                for job, (value, fault) in zip(batch, ran.results, strict=False):
                    yield Outcome(job, value, fault)
                if ran.refused is not None:
                    raise InputError(ran.refused)
        finally:
            tasks.cancel()

    def _timing_worker(self) -> str:
        """The worker that takes the timings: the same one as long as it lives."""
        if self._timer not in (there := self._client.nthreads()):
            self._timer = min(there, default=self._timer)
        return self._timer


class _Task(NamedTuple):
    """A batch that the cluster has. worker: the address of the one that alone is to run it, or None."""

    future: Any
    batch: Batch
    worker: str | None


class _Tasks:
    """Batches that the cluster has."""

    def __init__(self, client: Any, name: str, cluster: str) -> None:
        self._client, self._name, self._cluster = client, name, cluster
        self._under_way: dict[str, _Task] = {}
        self._done: SimpleQueue[Any] = SimpleQueue()

    def __len__(self) -> int:
        return len(self._under_way)

    def send(self, batch: Batch, worker: str | None = None) -> None:
        """Have a batch run somewhere, or by the worker of this address."""
        from pendbench.execution.cluster_worker import packed, run_batch

        calls = [packed(job) for job in batch]
        where: Any = {} if worker is None else {"workers": [worker]}
        future = self._client.submit(run_batch, self._name, calls, _WORTH_S, pure=False, **where)
        self._under_way[future.key] = _Task(future, batch, worker)
        future.add_done_callback(self._done.put)

    def next(self) -> tuple[Batch, Ran | None]:
        """A batch that has come to its end, and what came of it: None where its workers died again and again.

        Raises InputError where the study cannot go on.
        """
        task = self._ended()
        del self._under_way[task.future.key]
        return task.batch, self._came_of(task.future, task.batch)

    def _ended(self) -> _Task:
        """Wait for a task to end. It is also asked for, since what a dead worker had done is not told twice."""
        patience = Patience(self._client.nthreads)
        while True:
            with suppress(Empty):
                told = self._done.get(timeout=_PAUSE_S)
                if told.key in self._under_way and told.status not in _UNDER_WAY:
                    return self._under_way[told.key]
                continue
            for task in self._under_way.values():
                if task.future.status not in _UNDER_WAY:
                    return task
            there = self._client.nthreads()
            for task in self._under_way.values():
                if task.worker is not None and task.worker not in there:
                    return task
            if patience.ends(_PAUSE_S):
                raise self._lost()

    def _lost(self) -> InputError:
        return InputError(f"{lost(self._cluster)}; what was finished is kept")

    def _came_of(self, future: Any, batch: Batch) -> Ran | None:
        from distributed import KilledWorker

        from pendbench.execution.cluster_worker import Ran

        if future.status in _UNDER_WAY:  # for a worker that is no more
            future.cancel()
            return None
        try:
            ran: Ran = future.result()
        except KilledWorker:
            return None
        except (OSError, CancelledError, asyncio.CancelledError):
            raise self._lost() from None
        except Exception as error:
            return Ran([(None, Fault("error", describe(error)))] * len(batch))
        return ran

    def cancel(self) -> None:
        """Nobody waits for what is under way any more."""
        if self._under_way and self._client.status == "running":
            self._client.cancel([task.future for task in self._under_way.values()])
