"""An engine of two functions: for a build that has no adapter."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.faults import Fault
from pendbench.base.strict import show
from pendbench.engines.protocol import Mapped, Method, State, not_finite
from pendbench.scene.scene import Scene


@dataclass
class World:
    """What `step` gets where nothing else begins a run: the chain, and where it is; what else it needs it may add.

    scene: masses (n,) kg, lengths (n,) m, effects.gravity m/s^2. theta (n,) rad and omega (n,) rad/s, absolute; dt s.
    """

    scene: Scene
    theta: FloatArray
    omega: FloatArray
    dt: float


def world(scene: Scene, dt: float) -> World:
    """A chain at its start."""
    return World(scene, scene.angles.copy(), scene.rates.copy(), dt)


class _Run:
    def __init__(self, functions: FunctionEngine, scene: Scene, dt: float) -> None:
        self._its, self._n = functions, scene.n
        self._world = functions.start(scene, dt)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._its.step(self._world)

    def state(self) -> State:
        found = self._its.state(self._world)
        arrays = [np.array(each) for each in found] if isinstance(found, Iterable) else []
        if [each.shape for each in arrays] != [(self._n,)] * 2 or any(each.dtype.kind not in "iuf" for each in arrays):
            raise ValueError(f"state() gives {_told(found, arrays)}; allowed: angles and rates, {self._n} numbers each")
        theta, omega = arrays
        return State(theta.astype(np.float64), omega.astype(np.float64))

    def health(self) -> Fault | None:
        found = self._its.health(self._world) if self._its.health else None
        if found:
            return Fault("warned", str(found))
        return not_finite(self.state())


def _told(found: object, arrays: Sequence[npt.NDArray[Any]]) -> str:
    return ", ".join(f"{each.dtype} {each.shape}" for each in arrays[:3]) or show(found)


@dataclass
class FunctionEngine:
    """An engine with one method, made of functions.

    step(world): take one step. state(world): angles (n,) rad and rates (n,) rad/s, absolute. start(scene, dt): the
    world of a new run. health(world): what is wrong with it, in words, or None.
    """

    step: Callable[[Any], object]
    state: Callable[[Any], Any]
    start: Callable[[Scene, float], Any] = world
    health: Callable[[Any], str | None] | None = None
    order: int = 1
    name: str = "functions"
    release: str = "unknown"
    precision: str = "double"
    knows: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.methods: Mapping[str, Method] = {"step": Method(order=self.order, single=self.precision == "single")}
        self.effects = {name: Mapped("as its functions do") for name in ("gravity", *self.knows)}

    def version(self) -> str:
        """What was given."""
        return self.release

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        """Nothing."""
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> _Run:  # noqa: ARG002
        """A run at time 0."""
        if dt is None:
            raise ValueError("steps need a length")
        return _Run(self, scene, dt)
