"""One thing to run, and how it is called in files and messages."""

from __future__ import annotations

from dataclasses import dataclass

from pendbench.scene import Scene

Settings = tuple[tuple[str, float], ...]


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
    def content(self) -> tuple[object, ...]:
        """All that decides what the case does, but for the versions of programs."""
        return self.scene.digest, self.engine, self.method, self.dt, self.settings

    def __str__(self) -> str:
        step = "" if self.dt is None else f" dt={self.dt:g}"
        settings = f" {self.settings_text}" if self.settings else ""
        return f"{self.scene.name} {self.engine} {self.method}{step}{settings}"
