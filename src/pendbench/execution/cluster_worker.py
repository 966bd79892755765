"""What happens on a worker of a Dask cluster: each has a local pool, which runs the batches of jobs that come to it.

So a job has the same limits there as on one machine, and what it breaks is not Dask's.
"""

from __future__ import annotations

import multiprocessing
import pickle
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from distributed import Worker, WorkerPlugin, get_worker
from distributed.metrics import time

from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.base.source import source_digest
from pendbench.execution.pool import Job, LocalPool
from pendbench.execution.store import Store


class Packed(NamedTuple):
    """A job as it is sent: what to call, packed, and its limits."""

    call: bytes
    time_limit: float
    memory_limit: float | None
    wall_limit: float | None


@dataclass(frozen=True)
class Ran:
    """What came of a batch: value or fault of the jobs it got through, and the seconds that took.

    refused: why the worker did not go on, where it is the whole study that cannot.
    """

    results: list[tuple[Any, Fault | None]] = field(default_factory=list)
    seconds: float = 0.0
    refused: str | None = None


class Host(WorkerPlugin):
    """Gives each worker its pool, for as long as the study runs.

    digest: of the source that the jobs are from. store, token: what the jobs share, and a key with a value in it.
    """

    def __init__(self, name: str, digest: str, store: Store | None, token: str) -> None:
        self.name, self.digest, self.store, self.token = name, digest, store, token

    def setup(self, worker: Worker) -> None:
        """Look at what the worker has, and start its pool."""
        self.pool: LocalPool | None = None
        self.flaw = self._flaw(worker.address)
        if self.flaw is None:
            multiprocessing.current_process().daemon = False  # of its own accord Dask lets no worker start processes
            self.pool = LocalPool(worker.state.nthreads).__enter__()

    def teardown(self, worker: Worker) -> None:  # noqa: ARG002
        """End the pool, and what it may still be running for nobody."""
        if self.pool is not None:
            self.pool.__exit__(SystemExit, SystemExit(), None)

    def _flaw(self, address: str) -> str | None:
        if source_digest() != self.digest:
            return f"worker {address} has another version of pendbench; allowed: the same on every machine"
        if self.store is not None and self.store.load(self.token, str) != self.token:
            out = self.store.folder.parent
            return f"worker {address} does not see --out {out}; allowed: a folder that every machine sees by that path"
        return None


def flaw_of(name: str, dask_worker: Worker) -> str | None:
    """Why this worker cannot run jobs, or None."""
    host = dask_worker.plugins.get(name)
    return host.flaw if isinstance(host, Host) else "it did not start"


def run_batch(name: str, batch: list[Packed], seconds: float) -> Ran:
    """Run jobs one after the other, and begin none after so many seconds: what is left may be run elsewhere."""
    begun, results = time(), []
    host = get_worker().plugins[name]
    assert isinstance(host, Host)
    if host.pool is None:
        return Ran(refused=host.flaw)
    jobs = (unpacked(each) for each in batch)
    try:
        for outcome in host.pool.run(jobs, alone=True):
            results.append((outcome.value, outcome.fault))
            if time() - begun > seconds:
                break
    except InputError as error:
        return Ran(results, time() - begun, str(error))
    return Ran(results, time() - begun)


def packed(job: Job) -> Packed:
    """A job made ready to travel."""
    return Packed(pickle.dumps((job.function, job.arguments)), job.time_limit, job.memory_limit, job.wall_limit)


def unpacked(sent: Packed) -> Job:
    """A job that has travelled."""
    return Job("", call_packed, (sent.call,), sent.time_limit, sent.memory_limit, sent.wall_limit)


def call_packed(packed: bytes) -> Any:
    """Make a call that has travelled."""
    function, arguments = pickle.loads(packed)
    return function(*arguments)
