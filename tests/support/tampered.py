"""An engine for tests: the analytic one, with its runs in the hands of whoever the test puts between."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pendbench.base.faults import Fault
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.protocol import Method, Simulation, State
from pendbench.scene.scene import Scene

_ANALYTIC = AnalyticEngine()


def honest_build(scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
    """A run of the analytic engine."""
    return _ANALYTIC.build(scene, method, dt, **settings)


@dataclass
class Passing:
    """A run that passes everything on; a test replaces what it wants to spoil."""

    inner: Simulation

    def advance(self, steps: int) -> None:
        self.inner.advance(steps)

    def state(self) -> State:
        return self.inner.state()

    def health(self) -> Fault | None:
        return self.inner.health()


@dataclass
class Tampered:
    """An engine whose every part can be given."""

    make: Callable[..., Simulation] = honest_build
    name: str = "tampered"
    methods: Mapping[str, Method] = field(default_factory=lambda: {"rk4": Method(order=4)})
    says: Callable[[Scene], str | None] = lambda scene: None  # noqa: ARG005

    def version(self) -> str:
        return "1.0"

    def refuses(self, scene: Scene) -> str | None:
        return self.says(scene)

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> Simulation:
        return self.make(scene, method, dt, **settings)


def wrapping(spoiled: Callable[[Simulation], Simulation], order: int = 4) -> Tampered:
    """The engine whose runs are the analytic engine's `rk4`, wrapped."""
    return Tampered(
        make=lambda *given, **settings: spoiled(honest_build(*given, **settings)), methods={"rk4": Method(order=order)}
    )
