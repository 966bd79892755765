"""Engines that are deliberately wrong: negative controls, which a study must tell from the good ones.

They are plug-ins as somebody else's would be: `install` puts a distribution with their entry points into a folder.
"""

from __future__ import annotations

import dataclasses
import os
import resource
import signal
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType

import numpy as np

from pendbench.base.faults import Fault
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.protocol import Method, State
from pendbench.physics.dense import accelerations
from pendbench.scene.scene import Effects, FloatArray, Scene
from pendbench.truth.solve import solve_angles
from support.misprint import accelerations_as_printed

#: When the runs go wrong that begin well, s.
WELL_UNTIL = 1.0


class Run:
    """A run of a method with a fixed step, good unless a subclass says otherwise."""

    def __init__(self, scene: Scene, dt: float) -> None:
        self.scene, self.dt, self.taken = scene, dt, 0
        self.theta, self.omega = scene.angles.copy(), scene.rates.copy()

    @property
    def late(self) -> bool:
        return self.taken * self.dt > WELL_UNTIL

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self.step()
            self.taken += 1

    def step(self) -> None:
        """The classical Runge-Kutta method."""
        y, h = np.stack([self.theta, self.omega]), self.dt
        k1 = self.slope(y)
        k2 = self.slope(y + 0.5 * h * k1)
        k3 = self.slope(y + 0.5 * h * k2)
        k4 = self.slope(y + h * k3)
        self.theta, self.omega = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def slope(self, y: FloatArray) -> FloatArray:
        return np.stack([y[1], self.acceleration(*y)])

    def acceleration(self, theta: FloatArray, omega: FloatArray) -> FloatArray:
        return accelerations(self.scene, theta, omega)

    def state(self) -> State:
        return State(self.theta.copy(), self.omega.copy())

    def health(self) -> Fault | None:
        return None


class Engine:
    """An engine with one method; its class says what is wrong with it."""

    run: type[Run] = Run
    methods = MappingProxyType({"rk4": Method(order=4)})

    def version(self) -> str:
        return "1.0"

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        return None

    def build(self, scene: Scene, method: str, dt: float | None) -> object:  # noqa: ARG002
        return self.run(scene, dt)


class HeavyRun(Run):
    """Gravity is off by 0.1 %."""

    def __init__(self, scene: Scene, dt: float) -> None:
        super().__init__(scene, dt)
        self.scene = dataclasses.replace(scene, effects=Effects(gravity=1.001 * scene.effects.gravity))


class Heavy(Engine):
    name = "heavy"
    run = HeavyRun


class MisprintRun(Run):
    """Equation (19) of the note as it is printed."""

    def acceleration(self, theta: FloatArray, omega: FloatArray) -> FloatArray:
        return accelerations_as_printed(self.scene, theta, omega)


class Misprint(Engine):
    name = "misprint"
    run = MisprintRun


class HalfRun(Run):
    """The leapfrog method without its first half step: rates and angles of one time where they should be of two."""

    def step(self) -> None:
        self.omega = self.omega + self.dt * self.acceleration(self.theta, self.omega)
        self.theta = self.theta + self.dt * self.omega


class Half(Engine):
    name = "half"
    run = HalfRun
    methods = MappingProxyType({"leapfrog": Method(order=2)})


class SingleRun(Run):
    """Single precision: below its rounding no step brings the error down."""

    def step(self) -> None:
        super().step()
        self.theta, self.omega = (y.astype(np.float32).astype(float) for y in (self.theta, self.omega))


class Single(Engine):
    name = "single"
    run = SingleRun


class OracleRun(Run):
    """Knows the answer."""

    def __init__(self, scene: Scene, dt: float) -> None:
        super().__init__(scene, dt)
        self.solve = solve_angles(scene, self.times())  # type: ignore[arg-type]

    def times(self) -> Iterator[float]:
        while True:
            yield self.taken * self.dt

    def advance(self, steps: int) -> None:
        self.taken += steps
        self.theta, self.omega = next(self.solve)[:, 0].reshape(2, -1).copy()


class Oracle(Engine):
    name = "oracle"
    run = OracleRun


class Lazy(Engine):
    """Says that it needs no steps."""

    name = "lazy"
    methods = MappingProxyType({"adaptive": Method(order=8, adaptive=True)})

    def build(self, scene: Scene, method: str, dt: float | None) -> object:
        run = AnalyticEngine().build(scene, method, dt)
        good = run.advance_to
        run.advance_to = lambda time: 0 * good(time)
        return run


class LostRun(Run):
    """Loses itself, and does not notice."""

    def state(self) -> State:
        return State(self.theta * (np.nan if self.late else 1.0), self.omega)


class Lost(Engine):
    name = "lost"
    run = LostRun


class CrashingRun(Run):
    """Takes its process with it."""

    def step(self) -> None:
        if self.late:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            os.kill(os.getpid(), signal.SIGSEGV)
        super().step()


class Crashing(Engine):
    name = "crashing"
    run = CrashingRun


class HangingRun(Run):
    """Comes to no end when it is asked how it is."""

    def health(self) -> Fault | None:
        while self.late:
            pass
        return None


class Hanging(Engine):
    name = "hanging"
    run = HangingRun


class HungryRun(Run):
    """Takes 20 GB."""

    def step(self) -> None:
        if self.late:
            self.hoard = [np.empty(100_000_000, np.uint8) for _ in range(200)]  # never written to: no harm
        super().step()


class Hungry(Engine):
    name = "hungry"
    run = HungryRun


class ChattyRun(Run):
    """Prints a megabyte, and does well."""

    def __init__(self, scene: Scene, dt: float) -> None:
        super().__init__(scene, dt)
        print("x" * 1_000_000)


class Chatty(Engine):
    name = "chatty"
    run = ChattyRun


class MisshapenRun(Run):
    """Gives a column where a row is asked for."""

    def state(self) -> State:
        return State(self.theta[:, np.newaxis], self.omega)


class Misshapen(Engine):
    name = "misshapen"
    run = MisshapenRun


class ResetRun(Run):
    """Starts again from its initial state, and says so."""

    def step(self) -> None:
        super().step()
        if self.late:
            self.__init__(self.scene, self.dt)  # type: ignore[misc]
            self.was_reset = True

    def health(self) -> Fault | None:
        return Fault("reset", "its clock is behind") if hasattr(self, "was_reset") else None


class Reset(Engine):
    name = "reset"
    run = ResetRun


class Raising(Engine):
    """Fails wherever it is asked something."""

    name = "raising"

    def version(self) -> str:
        raise RuntimeError("no version")

    def refuses(self, scene: Scene) -> str | None:  # noqa: ARG002
        raise RuntimeError("no opinion")

    def build(self, scene: Scene, method: str, dt: float | None) -> object:  # noqa: ARG002
        raise RuntimeError("cannot be built")


class Picky(Engine):
    """Wants nothing of it."""

    name = "picky"

    def refuses(self, scene: Scene) -> str | None:
        return f"no chain of {scene.n}\nlinks"


CLASSES = (
    Heavy, Misprint, Half, Single, Oracle, Lazy, Lost, Crashing, Hanging, Hungry, Chatty, Misshapen, Reset, Raising,
    Picky,
)  # fmt: skip


def install(folder: Path) -> None:
    """Write the distribution `controls`, so that it is found where `folder` and that of the tests are on the path."""
    info = folder / "controls-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: controls\nVersion: 1.0\n")
    entries = "".join(f"{engine.name} = support.controls:{engine.__name__}\n" for engine in CLASSES)
    (info / "entry_points.txt").write_text(f"[pendbench.engines]\n{entries}")
