"""What a study asks for: calls whose results are kept under a key that follows from the function and its arguments."""

from __future__ import annotations

import typing
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

from pendbench.base.errors import InputError
from pendbench.base.source import source_digest
from pendbench.execution.content import key_of
from pendbench.execution.store import Store

R = TypeVar("R")


@dataclass(frozen=True, eq=False)
class Task(Generic[R]):
    """`function(*arguments, *what its needs found)`, made in another process.

    needs: tasks that are run before; where one has failed, None stands for what it would have found. share: of the
    study's time limit that this may take. The function's return annotation says of which type the result is.
    """

    function: Callable[..., R]
    arguments: tuple[object, ...]
    needs: tuple[Task[Any], ...] = ()
    share: float = 1.0

    @cached_property
    def key(self) -> str:
        """Changes with the function, with the content of every argument, and with that of what is needed."""
        return key_of(self.function, self.arguments, [need.key for need in self.needs])

    @property
    def result(self) -> type[R]:
        """The type of the result."""
        return result_of(self.function)


def task(
    function: Callable[..., R], *arguments: object, needs: tuple[Task[Any], ...] = (), share: float = 1.0
) -> Task[R]:
    """A task, as one writes a call."""
    return Task(function, arguments, needs, share)


def result_of(function: Callable[..., R]) -> type[R]:
    """The type that a function says it returns."""
    found: type[R] = typing.get_type_hints(function)["return"]
    return found


@dataclass(frozen=True)
class Needed:
    """What another task found and left in the store: the key it is kept under, and its type."""

    key: str
    result: type[Any]


class LostError(RuntimeError):
    """A result that was in the store cannot be read from it."""


def perform(
    function: Callable[..., R],
    arguments: tuple[object, ...],
    needed: tuple[Needed | None, ...],
    store: Store,
    source: str,
) -> R:
    """Make the call of a task, in the process where it is to run. None stands for what another task did not find.

    source: the digest that is in the task's key. Raises InputError where this process has another one, for the project
    was edited meanwhile, and LostError for what is not where it was left: what is found so must not be kept.
    """
    if source_digest() != source:
        raise InputError("the source of pendbench has changed since the study began; run the same line again")
    return function(*arguments, *(_loaded(need, store) for need in needed))


def _loaded(need: Needed | None, store: Store) -> object:
    if need is None:
        return None
    found: object = store.load(need.key, need.result)
    if found is None:
        raise LostError(f"the result {need.key} of another task cannot be read in {store.folder}")
    return found
