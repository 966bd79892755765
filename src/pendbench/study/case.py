"""One thing to run, and how it is called in files and messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from pendbench.engines.fingerprint import fingerprint
from pendbench.engines.protocol import Method
from pendbench.engines.registry import engine
from pendbench.scene.scene import Scene

Settings = tuple[tuple[str, float], ...]

#: The setting that stands for a step in a method that chooses its own.
TOLERANCE: Final = "tolerance"


def settings_text(settings: Settings) -> str:
    """Settings as ``iterations=50``, joined by spaces."""
    return " ".join(f"{name}={value:g}" for name, value in settings)


@dataclass(frozen=True)
class Case:
    """scene x engine x method x step (s; None for a method that chooses its own) x settings (sorted)."""

    scene: Scene
    engine: str
    method: str
    dt: float | None
    settings: Settings = ()

    @property
    def settings_text(self) -> str:
        """The settings as ``iterations=50``, joined by spaces."""
        return settings_text(self.settings)

    @property
    def its_method(self) -> Method:
        """The method, as its engine has it."""
        return engine(self.engine).methods[self.method]

    @property
    def order_claimed(self) -> int | None:
        """The method's order by its makers; None where it chooses its steps."""
        return None if self.its_method.adaptive else self.its_method.order

    @property
    def tolerance(self) -> float:
        """That of a method that chooses its steps, its default where none is given; nan for other methods."""
        settings = self.its_method.with_defaults(dict(self.settings))
        return settings.get(TOLERANCE, math.nan) if self.dt is None else math.nan

    @property
    def without_step(self) -> Case:
        """What it has in common with cases that differ in their step alone."""
        return replace(self, dt=None)

    @property
    def without_tolerance(self) -> Case:
        """The same without what stands for a step in its settings."""
        return replace(self, settings=tuple(pair for pair in self.settings if pair[0] != TOLERANCE))

    @property
    def chosen(self) -> tuple[object, ...]:
        """All that decides what is to be run, but for the engine's program."""
        return self.scene.digest, self.engine, self.method, self.dt, self.settings

    def content(self) -> tuple[object, ...]:
        """All that decides what the case does: under this its results are kept."""
        return *self.chosen, fingerprint(self.engine)

    def __str__(self) -> str:
        step = "" if self.dt is None else f" dt={self.dt:g}"
        settings = f" {self.settings_text}" if self.settings else ""
        return f"{self.scene.name} {self.engine} {self.method}{step}{settings}"
