"""A Dask cluster to run on: one that is there, found by its scheduler's address, or one made on this machine."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from typing import Any, Final, TypeVar

from pendbench.base.errors import InputError, describe
from pendbench.base.processes import deaf_to_interrupts, refuse_without_guard
from pendbench.base.source import source_digest
from pendbench.base.strict import show

#: In the place of an address: a cluster on this machine, as long as it is needed.
LOCAL: Final = "local"
# A scheduler on a busy machine is slow to answer. Where none listens, that is known at once.
_ANSWER_S: Final = 30.0
# A worker may still be starting.
_WORKERS_S: Final = 60.0
_PATIENCE_S: Final = 120.0
#: Before the workers are asked again, s: one of them may just have died, and its connection with it.
_PAUSES_S: Final = (0.2, 1.0, 3.0, 10.0, 30.0)
_OVER_TCP: Final = ("tcp", "tls")
_LOGGERS: Final = ("distributed", "distributed.client", "distributed.gc")
_T = TypeVar("_T")
_ALLOWED: Final = f"allowed: the address of a Dask scheduler, as in tcp://HOST:8786, or {LOCAL!r}"


def check_cluster(cluster: object) -> None:
    """Raise InputError where there is no Dask, or no cluster of this address."""
    if not isinstance(cluster, str) or not cluster.strip():
        raise InputError(f"cluster is {show(cluster)}; {_ALLOWED}")
    distributed = _dask()
    if cluster != LOCAL:
        _ask(distributed, cluster)


@contextmanager
def connected(cluster: str, workers: int) -> Iterator[Any]:
    """A `distributed.Client` of the cluster at an address, or of one made here with so many workers.

    Raises InputError, one line, where there is no Dask, no such cluster or no worker, and where the cluster is lost.
    """
    check_cluster(cluster)
    refuse_without_guard()
    distributed = _dask()
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        address = stack.enter_context(_local(distributed, workers)) if cluster == LOCAL else cluster
        client = stack.enter_context(distributed.Client(address, set_as_default=False))
        try:
            client.wait_for_workers(1, timeout=_WORKERS_S)
        except TimeoutError:
            raise InputError(f"cluster {cluster!r} has no workers; start one with: dask worker {address}") from None
        _check_versions(client, cluster)
        try:
            yield client
        except (distributed.KilledWorker, distributed.comm.CommClosedError, CancelledError, asyncio.CancelledError):
            raise InputError(lost(cluster)) from None


def _check_versions(client: Any, cluster: str) -> None:
    """Raise InputError where a worker has no pendbench, or another than this one."""
    try:
        found = asked_again(lambda: _digests(client))
    except Exception as error:  # whatever keeps a worker from loading what it needs
        raise InputError(f"cluster {cluster!r}: a worker cannot run pendbench ({describe(error)})") from None
    for worker, digest in sorted(found.items()):
        if digest != source_digest():
            said = f"worker {worker} has another version of pendbench"
            raise InputError(f"cluster {cluster!r}: {said}; allowed: the same on every machine")


def _digests(client: Any) -> dict[str, str]:
    """The version of every worker. Raises ConnectionError where there is none for now."""
    found: dict[str, str] = client.run(source_digest)
    if not found:
        raise ConnectionError("no worker is left")
    return found


def asked_again(ask: Callable[[], _T]) -> _T:
    """What the workers answer, asked again where one of them dies in the midst of it."""
    for pause in _PAUSES_S:
        try:
            return ask()
        except OSError:  # Dask's own of a closed connection is one, too
            time.sleep(pause)
    return ask()


class Patience:
    """How long to wait for workers that are no longer there: Dask may be starting others in their place.

    there: gives the workers, if any.
    """

    def __init__(self, there: Callable[[], object]) -> None:
        self._there, self._alone = there, 0.0

    def ends(self, waited: float) -> bool:
        """After having waited for so many seconds more: whether it is in vain."""
        self._alone = 0.0 if self._there() else self._alone + waited
        return self._alone >= _PATIENCE_S


def lost(cluster: str) -> str:
    """What there is to say where a cluster is no longer there."""
    return f"cluster {cluster!r}: its scheduler or all of its workers are gone"


def _dask() -> Any:
    try:
        import distributed
        import distributed.comm
    except ImportError as error:
        said = f"a cluster needs Dask, which cannot be loaded ({describe(error)})"
        raise InputError(f'{said}; install it with: pip install --upgrade "pendbench[dask]"') from None
    return distributed


@contextmanager
def _quiet() -> Iterator[None]:
    """Dask keeps what it thinks of lost workers and late schedulers to itself: a user is told once, and by us."""
    before = {name: logging.getLogger(name).level for name in _LOGGERS}
    for name in _LOGGERS:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


@contextmanager
def _local(distributed: Any, workers: int) -> Iterator[str]:
    """The address of a cluster of this machine with one process for each worker; jobs have their own memory limit.

    Of its own accord Dask gives up on a worker that died where the next one takes 15 s to come, as on a busy machine.
    """
    import dask

    settings: Any = {"dashboard_address": "127.0.0.1:0", "memory_limit": 0, "silence_logs": logging.CRITICAL + 1}
    try:
        with deaf_to_interrupts():
            cluster = distributed.LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, **settings)
    except RuntimeError as error:
        raise InputError(f"cluster {LOCAL!r}: does not start ({describe(error)})") from None
    with dask.config.set({"distributed.deploy.lost-worker-timeout": _PATIENCE_S}), cluster:
        yield cluster.scheduler_address


def _ask(distributed: Any, address: str) -> None:
    """Raise InputError where no Dask scheduler answers.

    It is asked before there is a client: one that cannot connect goes on to complain when it is thrown away.
    """
    with ThreadPoolExecutor(1) as thread:  # there may be a loop in this one, as in a notebook
        try:
            _reach(distributed, address)
            found = thread.submit(asyncio.run, _identity(distributed, address)).result()
        except Exception as error:  # whatever it is that answers there
            raise InputError(f"cluster {address!r} does not answer ({describe(error)}); {_ALLOWED}") from None
    if found.get("type") != "Scheduler":
        raise InputError(f"cluster {address!r} is a {found.get('type')} of Dask; {_ALLOWED}")


def _reach(distributed: Any, address: str) -> None:
    """Raise OSError at once where nobody listens at an address, or ValueError: Dask would try again and again."""
    scheme, place = distributed.comm.parse_address(address)
    if scheme in _OVER_TCP:
        socket.create_connection(distributed.comm.parse_host_port(place), timeout=_ANSWER_S).close()


async def _identity(distributed: Any, address: str) -> dict[str, Any]:
    async def ask() -> dict[str, Any]:
        async with distributed.rpc(address, timeout=_ANSWER_S) as scheduler:
            return dict(await scheduler.identity())

    return await asyncio.wait_for(ask(), 2 * _ANSWER_S)
