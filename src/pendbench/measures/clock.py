"""How long stepping takes. Nothing else is timed, one case at a time, and what the timings are worth is said."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.faults import Fault
from pendbench.base.second_thread import spent_beside
from pendbench.engines.protocol import AdaptiveSimulation, Engine, Simulation, State
from pendbench.scene.scene import Scene

T = TypeVar("T")

REPEATS = 5
_READINGS = 200
_MOST_RUNS = 100  # that are put together for one sample, where each is short
_OTHERS, _TICKS = 1.2, 0.1  # of our threads' own time, and s, beyond which a process's time is that of others, too
_LONGER = 1.5  # what twice the steps take at least, over what the steps took, where it is steps that are timed
_CALL_S = 0.05  # what no call takes but for its steps
_SAMPLE_S = 0.01  # a sample shorter than this is mostly the clock's own noise


class Timing(NamedTuple):
    """step_us: the median cost of a step. spread: (largest - smallest) / median of the samples. steps: in one sample.

    build_s: building the run. first_call_s: the first step of the first run, with what is compiled or loaded then.
    run_s: stepping up to the time that was asked for (measured for an adaptive method, the steps' cost otherwise).
    """

    step_us: float
    spread: float
    steps: int
    build_s: float
    first_call_s: float
    run_s: float


def _fixed(engine: Engine, scene: Scene, method: str, dt: float, settings: dict[str, float], until: float) -> Timing:
    """Samples of steps inside the time that is asked about: past it a run may have failed, and failing is quick."""

    def build() -> Simulation:
        simulation = engine.build(scene, method, dt, **settings)
        assert isinstance(simulation, Simulation)
        return simulation

    total = max(1, round(until / dt))
    first = build()
    first_call = _seconds(partial(first.advance, 1))
    steps = _steps_of_sample(build(), total)
    samples, builds = [], []
    for _ in range(REPEATS):
        spent, taken = 0.0, 0
        while spent < _SAMPLE_S and taken < _MOST_RUNS * steps:
            begun = time.perf_counter()
            simulation = build()
            builds.append(time.perf_counter() - begun)
            spent += _seconds(partial(simulation.advance, steps))
            taken += steps
        samples.append(spent / taken)
    median = float(np.median(samples))
    spread = float(np.ptp(samples)) / median
    return Timing(median * 1e6, spread, taken, float(np.median(builds)), first_call, median * total)


def _steps_of_sample(simulation: Simulation, most: int) -> int:
    """How many of a run's steps fill a sample: so many that the call itself is not what is timed."""
    taken, steps, before, spent = 0, 1, math.inf, 0.0
    while taken + steps <= most and (spent < _SAMPLE_S / 4 or spent < min(_LONGER * before, _CALL_S)):
        before, spent = spent or math.inf, _seconds(partial(simulation.advance, steps))
        taken += steps
        steps *= 2
    last = steps // 2
    if 2.0 * before - spent > 0.1 * spent:  # that is the call
        return max(1, last)
    return max(1, min(most, round(last * _SAMPLE_S / max(spent, 1e-9))))


def _adaptive(engine: Engine, scene: Scene, method: str, settings: dict[str, float], until: float) -> Timing:
    """Samples of whole runs, from the start and without a stop: several in one sample, where they are short."""
    builds: list[float] = []

    def build() -> AdaptiveSimulation:
        begun = time.perf_counter()
        simulation = engine.build(scene, method, None, **settings)
        builds.append(time.perf_counter() - begun)
        assert isinstance(simulation, AdaptiveSimulation)
        return simulation

    first = build()
    first_call = _seconds(lambda: first.advance_to(1e-6 * until))
    samples, steps = [], 1
    for _ in range(REPEATS):
        spent, runs = 0.0, 0
        while spent < _SAMPLE_S and runs < _MOST_RUNS:
            simulation = build()
            begun = time.perf_counter()
            steps = max(1, simulation.advance_to(until))
            spent += time.perf_counter() - begun
            runs += 1
        samples.append(spent / runs)
    median = float(np.median(samples))
    spread = float(np.ptp(samples)) / median
    return Timing(median / steps * 1e6, spread, steps, float(np.median(builds)), first_call, median)


def _seconds(call: Callable[[], object]) -> float:
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


def time_case(
    engine: Engine, scene: Scene, method: str, dt: float | None, settings: dict[str, float], until: float
) -> Timing:
    """Time a method of an engine on a scene, `run_s` up to the time `until` (s)."""
    if dt is None:
        return _adaptive(engine, scene, method, settings, until)
    return _fixed(engine, scene, method, dt, settings, until)


def time_each_step(
    engine: Engine, scene: Scene, method: str, dt: float | None, settings: dict[str, float], interval: float
) -> float:
    """The median cost, us, of one step and of reading the state, from Python.

    For a method that chooses its steps: of advancing by `interval` (s) and reading it, which is what is asked of it.
    """
    simulation = engine.build(scene, method, dt, **settings)
    samples = []
    for i in range(_READINGS):
        begun = time.perf_counter()
        if isinstance(simulation, Simulation):
            simulation.advance(1)
        else:
            simulation.advance_to((i + 1) * interval)
        simulation.state()
        samples.append(time.perf_counter() - begun)
    return float(np.median(samples[_READINGS // 10 :])) * 1e6


class Race(NamedTuple):
    """How far a run came: simulated time reached, processor time spent stepping, s, and whether it was lost.

    lost: `is_lost` said so of a sample's time (s) and state, or the engine said that something was wrong: fault.
    """

    reached: float
    spent: float
    lost: bool
    fault: Fault | None = None


def race(
    engine: Engine,
    scene: Scene,
    method: str,
    dt: float | None,
    settings: dict[str, float],
    times: FloatArray,
    is_lost: Callable[[float, State], bool],
) -> Race:
    """Run the scene until stepping has taken longer than all of the motion lasts, or until it is lost.

    times: (k,) s, rising, at which it is looked at, the last of them its end; with a fixed step multiples of it. It is
    processor time that counts, of the steps alone: whatever else the machine does, the verdict is the same.
    """
    simulation = engine.build(scene, method, dt, **settings)
    watch, taken = _Stopwatch(), 0
    for moment in times.tolist():
        steps = 0 if dt is None else round(moment / dt) - taken
        with watch:
            if isinstance(simulation, Simulation):
                simulation.advance(steps)
            else:
                simulation.advance_to(moment)
        taken += steps
        fault = simulation.health()
        if fault is not None or is_lost(moment, simulation.state()):
            return Race(moment, watch.spent, lost=True, fault=fault)
        if watch.spent > times[-1]:
            return Race(moment, watch.spent, lost=False)
    return Race(float(times[-1]), watch.spent, lost=False)


def _own_time() -> float:
    """Processor time of this thread and of the one that works beside it, s."""
    return time.thread_time() + spent_beside()


class _Stopwatch:
    """Processor time of blocks, s. Where a process has a limit of it, its clock goes by the system's ticks of some
    milliseconds; that of a thread does not, and is taken unless threads have worked that are not our own.
    """

    def __init__(self) -> None:
        self._own, self._whole = 0.0, 0.0

    def __enter__(self) -> None:
        self._begun = _own_time(), time.process_time()

    def __exit__(self, *_: object) -> None:
        own, whole = self._begun
        self._own += _own_time() - own
        self._whole += time.process_time() - whole

    @property
    def spent(self) -> float:
        """So far."""
        return self._whole if self._whole > _OTHERS * self._own + _TICKS else self._own


def timed(call: Callable[[], T]) -> tuple[T, float]:
    """What a call returns, and the processor time that it took, s: whatever else the machine does meanwhile."""
    begun = time.process_time()
    value = call()
    return value, time.process_time() - begun
