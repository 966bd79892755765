"""Run a scene through an engine and record what it does. The one recording loop, for all engines and methods."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench import __version__
from pendbench.base.arrays import FloatArray, all_finite
from pendbench.base.errors import InputError, choose, describe, printable
from pendbench.base.faults import STATUSES, Fault
from pendbench.base.ranges import rising_times
from pendbench.base.strict import show
from pendbench.engines.arguments import SAMPLES, even_counts, step_counts, step_of
from pendbench.engines.protocol import AdaptiveSimulation, Engine, Method, Simulation, State, default_method, refusal
from pendbench.engines.registry import engine as engine_of
from pendbench.engines.registry import engine_names, flaw_of
from pendbench.execution.limits import uncounted
from pendbench.scene.scene import Scene, scene_of
from pendbench.scene.trajectory import Maker, Trajectory

# Steps in one call of an engine, times links: some milliseconds of work, beside which the call itself is nothing.
_LINKS_A_CALL: Final = 2000


@dataclass(frozen=True)
class Asked:
    """What is to be run, checked: every name is known, every number allowed.

    times: (k,) s. steps: (k,) how many steps each of them is from the start; None for an adaptive method, and dt too.
    """

    scene: Scene
    engine: Engine
    method: str
    dt: float | None
    times: FloatArray
    steps: npt.NDArray[np.int64] | None
    settings: Mapping[str, float]


def simulate(
    scene: Scene | str | os.PathLike[str],
    engine: str | Engine = "analytic",
    method: str | None = None,
    dt: float | None = None,
    times: npt.ArrayLike | None = None,
    **settings: float | None,
) -> Trajectory:
    """Run a scene, from its start, and record it.

    scene: a `Scene`, or what `load_scene` takes. engine: its name, or the engine itself. method: its name; by default
    the engine's first one, and of ours the cheapest for the scene and its tolerance (docs/speed.md). dt: the step, s,
    for a method with a fixed step and only for such. times: (k,) s, increasing, where to record; they may lie beyond
    the scene's duration. With a fixed step they must be whole multiples of it, to a millionth of it, and the run's `t`
    holds those multiples. Without times, about 1000 over the scene's duration. settings: what the method can be given,
    by name; None stands for the default.

    A method that chooses its steps ends one at each of the times, unless it is `dense` (of the bundled ones, `taylor`
    of the analytic engine). Where the times are closer together than the steps that its tolerance would allow, they
    decide how good the run is, and the tolerance changes nothing.

    A run that goes wrong is not an error here: its status says so, and it holds what was recorded before.

    >>> import pendbench as pb
    >>> pb.simulate("double", engine="mujoco", method="rk4", dt=1e-3, times=[0.0, 1.0])
    <Trajectory of 'double' by mujoco rk4 dt=0.001: 2 samples of 2 links, 0 to 1 s, ok>

    Raises `InputError`, one line, for whatever is asked for that makes no sense.
    """
    return record(plan(scene, engine, method=method, dt=dt, times=times, settings=settings))


def plan(
    scene: Scene | str | os.PathLike[str],
    engine: str | Engine,
    *,
    method: str | None,
    dt: float | None,
    times: npt.ArrayLike | None,
    settings: Mapping[str, float | None],
) -> Asked:
    """Check what `simulate` was asked for. Raises `InputError`."""
    chosen = scene_of(scene)
    its = engine_of(engine) if isinstance(engine, str) else engine
    if flaw := flaw_of(its):
        raise InputError(f"engine is {show(engine)}, which is none ({flaw}); allowed: {', '.join(engine_names())}")
    name = default_method(its, chosen, settings) if method is None else method
    if name not in its.methods:
        raise InputError(f"engine {its.name!r}: {choose('method', printable(str(name)), its.methods)}")
    numbers = _settings(name, its.methods[name], settings)
    step = step_of(name, its.methods[name].adaptive, dt)
    asked = None if times is None else rising_times(times)
    if step is None:
        if asked is None:
            asked = np.linspace(0.0, chosen.duration, SAMPLES + 1)
        return Asked(chosen, its, name, None, asked, None, numbers)
    counts = even_counts(chosen.duration, step) if asked is None else step_counts(asked, step)
    return Asked(chosen, its, name, step, np.asarray(counts * step, np.float64), counts, numbers)


def _settings(name: str, method: Method, given: Mapping[str, float | None]) -> dict[str, float]:
    for key in given:
        if key not in method.settings:
            raise InputError(f"method {name!r}: {choose('setting', printable(key), method.settings)}")
    return {key: method.settings[key].read(key, value) for key, value in given.items() if value is not None}


def record(asked: Asked) -> Trajectory:
    """Run what a plan says. Whatever the engine does, it ends in a trajectory and not in an exception."""
    samples = Samples(asked.scene.n)
    maker = _maker(asked)
    try:
        refused = refusal(asked.engine, asked.method, asked.scene)
        fault = Fault("refused", str(refused)) if refused is not None else _fill(samples, asked)
    except MemoryError as error:
        fault = Fault("out of memory", describe(error))
    except Exception as error:
        fault = Fault("error", describe(error))
    return replace(samples.trajectory(fault), scene=asked.scene, maker=maker)


def _maker(asked: Asked) -> Maker:
    """What makes the run. An engine that cannot tell its version will not run much better."""
    try:
        version = str(asked.engine.version())
    except Exception as error:
        version = describe(error)
    versions = (("pendbench", __version__), (asked.engine.name, version))
    return Maker(asked.engine.name, asked.method, asked.dt, tuple(sorted(asked.settings.items())), versions)


def _fill(samples: Samples, asked: Asked) -> Fault | None:
    with uncounted():  # engines that compile for each scene do it here
        run = asked.engine.build(asked.scene, asked.method, asked.dt, **asked.settings)
    for time, taken in zip(asked.times.tolist(), _advanced(run, asked), strict=True):
        samples.steps += taken
        fault = fault_of(run) or samples.add(time, run.state())
        if fault is not None:
            return fault
    return None


def _advanced(run: Simulation | AdaptiveSimulation, asked: Asked) -> Iterator[int]:
    """Advance to each of the times asked for, and say how many steps that took."""
    if asked.steps is None:
        if not isinstance(run, AdaptiveSimulation):
            raise TypeError("an adaptive run has no advance_to()")
        for time in asked.times.tolist():
            yield int(run.advance_to(time)) if time > 0.0 else 0
        return
    if not isinstance(run, Simulation):
        raise TypeError("a run with a fixed step has no advance()")
    most = max(1, _LINKS_A_CALL // asked.scene.n)
    for steps in np.diff(asked.steps, prepend=0).tolist():
        _advance(run, steps, most)
        yield steps


def _advance(run: Simulation, steps: int, most: int) -> None:
    """Take the steps, `most` in a call: an engine at work in another language does not hear an interrupt."""
    for taken in range(0, steps, most):
        run.advance(min(most, steps - taken))


def fault_of(run: Simulation | AdaptiveSimulation) -> Fault | None:
    """What the run says is wrong with it, or what is wrong with its saying so."""
    found: Any = run.health()
    if found is None:
        return None
    if isinstance(found, tuple) and len(found) == 2 and found[0] in STATUSES and found[0] != "ok":
        return Fault(found[0], str(found[1]))
    return Fault("error", f"health() gave {show(found)}, which is not a Fault")


@dataclass
class Samples:
    """The samples of a run of n links, as they come, and how many steps were taken."""

    n: int
    steps: int = 0
    _t: list[float] = field(default_factory=list)
    _states: list[State] = field(default_factory=list)

    def add(self, time: float, state: State) -> Fault | None:
        """Take the state at a time, or say why it is none."""
        theta, omega = np.asarray(state.theta, dtype=np.float64), np.asarray(state.omega, dtype=np.float64)
        if theta.shape != (self.n,) or omega.shape != (self.n,):
            shapes = f"theta {theta.shape} and omega {omega.shape}"
            return Fault("error", f"state() gave {shapes}; a chain of {self.n} has ({self.n},)")
        if not all_finite(theta, omega):
            return Fault("not finite", f"an angle or a rate is not finite at t = {time:.6g} s")
        self._t.append(time)
        self._states.append(State(theta.copy(), omega.copy(), float(state.gap)))
        return None

    def trajectory(self, fault: Fault | None) -> Trajectory:
        """What was recorded, with what ended it."""
        return Trajectory(
            t=np.array(self._t),
            theta=np.array([state.theta for state in self._states]).reshape(-1, self.n),
            omega=np.array([state.omega for state in self._states]).reshape(-1, self.n),
            gap=np.array([state.gap for state in self._states]),
            status="ok" if fault is None else fault.status,
            reason="" if fault is None else printable(fault.reason),
            steps=self.steps,
        )
