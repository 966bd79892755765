"""Run a scene through an engine and record what it does. The one recording loop, for all engines and methods."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.arrays import FloatArray
from pendbench.engines.protocol import AdaptiveSimulation, Engine, Fault, Method, Setting, Simulation, State, refusal
from pendbench.engines.registry import engine as engine_of
from pendbench.engines.registry import engine_names, flaw_of
from pendbench.errors import InputError, choose, describe, printable
from pendbench.ranges import STEP
from pendbench.scene import Scene, load_scene
from pendbench.strict import show
from pendbench.trajectory import STATUSES, Trajectory

#: How many samples a run has, about, where no times are asked for.
SAMPLES: Final = 1000
#: How far a time may be from a whole number of steps, in steps.
SLACK: Final = 1e-6

_MOST_STEPS: Final = 2**53  # beyond this, floats do not count


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
    the first one of the engine. dt: the step, s, for a method with a fixed step and only for such. times: (k,) s,
    increasing, where to record; they may lie beyond the scene's duration. With a fixed step they must be whole
    multiples of it, to `SLACK`, and `Trajectory.t` holds those multiples. Without times, about `SAMPLES` over the
    scene's duration. settings: what the method can be given, by name; None stands for the default.

    A run that goes wrong is not an error here: its status says so, and it holds what was recorded before.

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
    chosen = scene if isinstance(scene, Scene) else load_scene(scene)
    its = engine_of(engine) if isinstance(engine, str) else engine
    if flaw := flaw_of(its):
        raise InputError(f"engine is {show(engine)}, which is none ({flaw}); allowed: {', '.join(engine_names())}")
    name = next(iter(its.methods)) if method is None else method
    if name not in its.methods:
        raise InputError(f"engine {its.name!r}: {choose('method', printable(str(name)), its.methods)}")
    numbers = _settings(name, its.methods[name], settings)
    step = _step(name, its.methods[name], dt)
    asked = None if times is None else _times(times)
    if step is None:
        if asked is None:
            asked = np.linspace(0.0, chosen.duration, SAMPLES + 1)
        return Asked(chosen, its, name, None, asked, None, numbers)
    counts = _even_counts(chosen.duration, step) if asked is None else step_counts(asked, step)
    return Asked(chosen, its, name, step, np.asarray(counts * step, np.float64), counts, numbers)


def _settings(name: str, method: Method, given: Mapping[str, float | None]) -> dict[str, float]:
    for key in given:
        if key not in method.settings:
            raise InputError(f"method {name!r}: {choose('setting', printable(key), method.settings)}")
    return {key: _setting(key, method.settings[key], value) for key, value in given.items() if value is not None}


def _setting(key: str, setting: Setting, value: object) -> float:
    number: Any = value
    fits = isinstance(value, Real) and not isinstance(value, bool) and setting.low <= number <= setting.high
    if not fits or (setting.integer and number != int(number)):
        kind = "a whole number" if setting.integer else "a number"
        raise InputError(f"{key} is {show(value)}; allowed: {kind} from {setting.low:g} to {setting.high:g}")
    return int(number) if setting.integer else float(number)


def _step(name: str, method: Method, dt: object) -> float | None:
    if method.adaptive:
        if dt is not None:
            raise InputError(f"dt is {show(dt)}; allowed: none, since method {name!r} chooses its steps")
        return None
    try:
        return STEP.read(dt)
    except ValueError as error:
        found = "missing" if dt is None else show(dt)
        raise InputError(f"dt is {found}; allowed: {error}, the step of method {name!r}") from None


def _times(times: npt.ArrayLike) -> FloatArray:
    try:
        array = np.asarray(times)
    except (ValueError, TypeError):
        array = np.asarray(None)
    if array.ndim != 1 or array.size == 0 or array.dtype.kind not in "iuf":
        raise InputError("times is not a list of numbers; allowed: one time or more, s")
    array = array.astype(np.float64)
    if not (np.all(np.isfinite(array)) and array[0] >= 0.0 and np.all(np.diff(array) > 0.0)):
        raise InputError("times is not in order; allowed: finite times from 0 on, each later than the one before, s")
    return array


def step_counts(times: FloatArray, dt: float) -> npt.NDArray[np.int64]:
    """How many steps of dt (s) each of the times (k,) s is from the start; InputError for what is no whole multiple."""
    with np.errstate(over="ignore"):
        counts = _bounded(times / dt, dt)
    whole = np.rint(counts)
    astray = np.flatnonzero(np.abs(counts - whole) > SLACK)
    if astray.size:
        raise InputError(f"times has {times[astray[0]]:.9g} s; allowed: whole multiples of dt = {dt:g} s")
    if np.any(np.diff(whole) < 1):
        raise InputError(f"times are closer together than dt = {dt:g} s; allowed: different multiples of it")
    return whole.astype(np.int64)


def _even_counts(duration: float, dt: float) -> npt.NDArray[np.int64]:
    """About `SAMPLES` counts of steps, evenly spaced from 0, and the last step within the duration."""
    total = math.floor(_bounded(np.array([duration / dt]), dt)[0] + SLACK)
    if total < 1:
        raise InputError(f"dt is {dt:g}; allowed: at most the scene's duration of {duration:g} s")
    stride = max(1, round(total / SAMPLES))
    return np.unique(np.append(np.arange(0, total, stride), total))


def _bounded(counts: FloatArray, dt: float) -> FloatArray:
    if not np.all(counts < _MOST_STEPS):
        raise InputError(f"dt is {dt:g}; allowed: steps of which the run needs at most {_MOST_STEPS:g}")
    return counts


def record(asked: Asked) -> Trajectory:
    """Run what a plan says. Whatever the engine does, it ends in a trajectory and not in an exception."""
    samples = Samples(asked.scene.n)
    try:
        refused = refusal(asked.engine, asked.method, asked.scene)
        fault = Fault("refused", str(refused)) if refused is not None else _fill(samples, asked)
    except MemoryError as error:
        fault = Fault("out of memory", describe(error))
    except Exception as error:
        fault = Fault("error", describe(error))
    return samples.trajectory(fault)


def _fill(samples: Samples, asked: Asked) -> Fault | None:
    run = asked.engine.build(asked.scene, asked.method, asked.dt, **asked.settings)
    for i, time in enumerate(asked.times):
        if asked.steps is None:
            samples.steps += _advance_to(run, float(time))
        else:
            samples.steps += _advance(run, int(asked.steps[i]) - samples.steps)
        fault = fault_of(run) or samples.add(float(time), run.state())
        if fault is not None:
            return fault
    return None


def _advance(run: Simulation | AdaptiveSimulation, steps: int) -> int:
    if not isinstance(run, Simulation):
        raise TypeError("a run with a fixed step has no advance()")
    if steps:
        run.advance(steps)
    return steps


def _advance_to(run: Simulation | AdaptiveSimulation, time: float) -> int:
    if not isinstance(run, AdaptiveSimulation):
        raise TypeError("an adaptive run has no advance_to()")
    return int(run.advance_to(time)) if time > 0.0 else 0


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
        if not (np.all(np.isfinite(theta)) and np.all(np.isfinite(omega))):
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
