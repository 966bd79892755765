"""How far a study is, shown in the terminal."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars


class StageBars:
    """A bar for each stage, on standard error; a line for each where that is no terminal."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._bars = Bars(
            TextColumn("{task.description:28}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._stage: TaskID | None = None

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bars.stop()

    def begin(self, stage: str, total: int, done: int) -> None:
        """A stage of `total` jobs begins, `done` of them found on disk."""
        if not self._console.is_terminal:
            kept = f", {done} kept from before" if done else ""
            self._console.print(f"{stage}: {total} jobs{kept}", markup=False, highlight=False)
        self._stage = self._bars.add_task(stage, total=total, completed=done)

    def advance(self) -> None:
        """One more job of the stage is done."""
        if self._stage is not None:
            self._bars.advance(self._stage)
