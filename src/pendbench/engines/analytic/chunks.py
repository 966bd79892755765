"""Starts of an ensemble in chunks, handed out to threads or to the machines of a cluster."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.processes import processors
from pendbench.base.strict import show
from pendbench.execution.connect import LOCAL, Patience, connected, lost

Progress = Callable[[int, int], None]
#: Another thread makes it other than 0 to end what runs: an array of one integer.
Halt = npt.NDArray[np.int64]
#: Runs some starts (K, 2n): their states (k, K, 2n) and statuses; or the times of their flips.
Run = Callable[[FloatArray, Halt], tuple[Any, Any]]

#: How many runs go side by side at most: enough to hide what a division takes.
LANES: Final = 64
# Links of the runs that are handed out together: enough to be worth it, few enough to be told of and to be cancelled.
_CHUNK_LINKS: Final = 1 << 13
# A cluster is asked after so long, s, and then after twice as long each time, to the longest: what takes long to
# arrive is given the time.
_PAUSE_S: Final = 2.0
_LONGEST_PAUSE_S: Final = 64.0


@contextmanager
def _pool(threads: int | None, cluster: str | None) -> Iterator[tuple[Callable[..., Any], int, Patience]]:
    """What submits chunks, how many run at once, and how long to wait for those that run them."""
    workers = _workers(threads)
    if cluster is None:
        with ThreadPoolExecutor(workers) as pool:
            yield pool.submit, workers, Patience(lambda: True)
        return
    if threads is not None and cluster != LOCAL:
        raise InputError(f"threads is {threads}; allowed: none, since a cluster has the workers that it has")
    with connected(cluster, workers) as client:
        # Not through Dask's executor: where a result cannot be fetched, its future never ends.
        there = max(1, sum(client.nthreads().values()))
        yield partial(client.submit, pure=False), there, Patience(client.nthreads)


def in_chunks(
    make: Callable[[], Run],
    starts: FloatArray,
    threads: int | None,
    cluster: str | None,
    progress: Progress | None,
) -> Iterator[Any]:
    """The results of chunks of the starts, in order: (low, high, what `Run` gave for the starts from low to high).

    A generator that is closed cancels the others. Those that have begun in a thread are told to halt: it is compiled
    code that does not hear an interrupt.
    """
    if progress is not None and not callable(progress):
        raise InputError(f"progress is {show(progress)}; allowed: a function of how many are done, and of how many")
    make()  # what cannot be used is refused before anything runs
    halt: Halt = np.zeros(1, np.int64)
    waiting: list[tuple[int, int, Any]] = []
    with _pool(threads, cluster) as (submit, workers, patience):
        size = _chunk(len(starts), starts.shape[1], workers)
        bounds = ((low, min(low + size, len(starts))) for low in range(0, len(starts), size))
        try:
            while True:
                for low, high in itertools.islice(bounds, 2 * workers - len(waiting)):
                    waiting.append((low, high, submit(_run_chunk, make, starts[low:high], halt)))
                if not waiting:
                    return
                low, high, future = waiting.pop(0)
                yield low, high, *_result(future, patience, cluster)
                if progress is not None:
                    progress(high, len(starts))
        finally:
            halt[0] = 1
            for _, _, future in waiting:
                future.cancel()


def _result(future: Any, patience: Patience, cluster: str | None) -> Any:
    """What a chunk gave. Raises InputError where there has been nobody to run it for long."""
    pause = _PAUSE_S
    while True:
        try:
            return future.result(timeout=pause)
        except TimeoutError:
            if patience.ends(pause):
                raise InputError(lost(str(cluster))) from None
            pause = min(2.0 * pause, _LONGEST_PAUSE_S)


def _chunk(runs: int, d: int, workers: int) -> int:
    """How many of the runs, of d numbers each, are handed out together: whole lanes, and some for every worker."""
    most = min(2 * _CHUNK_LINKS // d, math.ceil(runs / workers))
    return max(1, math.ceil(most / LANES)) * LANES


def _run_chunk(make: Callable[[], Run], starts: FloatArray, halt: Halt) -> tuple[Any, Any]:
    """Make what runs some starts where they are to be run: it cannot travel itself."""
    return make()(starts, np.require(halt, requirements="W"))  # kernels are compiled for arrays that can be written


def _workers(threads: int | None) -> int:
    if threads is None:
        return processors()
    if type(threads) is not int or not 1 <= threads <= 1024:
        raise InputError(f"threads is {show(threads)}; allowed: 1 to 1024")
    return threads
