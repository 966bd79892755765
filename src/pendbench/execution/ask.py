"""Questions to somebody else's code: asked in a worker process, so that no answer can end or hold up the program."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final, TypeVar

from pendbench.base.faults import Fault
from pendbench.base.processes import processors
from pendbench.execution.pool import Job, LocalPool

#: What an answer may take, s: of processor time, and by the clock where somebody waits for it.
ANSWER_S: Final = 30.0
_HANGS_S: Final = 120.0

T = TypeVar("T")


def ask(function: Callable[..., T], *arguments: Any) -> T | Fault:
    """What `function(*arguments)` returns in a process of its own, or why it does not.

    The function is one that a worker can import. Raises InputError where it does.
    """
    return ask_each(function, [arguments])[0]


def ask_each(function: Callable[..., T], arguments: Iterable[tuple[Any, ...]]) -> list[T | Fault]:
    """The same for each tuple of arguments, in their order, in as few processes as there are processors.

    Whoever crashes or hangs keeps none of the others from answering.
    """
    jobs = [Job(str(i), function, each, ANSWER_S, wall_limit=_HANGS_S) for i, each in enumerate(arguments)]
    if not jobs:
        return []
    with LocalPool(min(len(jobs), processors())) as pool:
        found = {outcome.job.key: outcome for outcome in pool.run(jobs)}
    return [found[job.key].fault or found[job.key].value for job in jobs]
