"""Runs made ready for the stage: where the masses are, how far from the truth, and what became of the energy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError, MissingEngineError, printable
from pendbench.base.faults import Fault
from pendbench.engines.protocol import Engine, Method, refusal
from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine, engine_names, only_by_name
from pendbench.measures.divergence import time_to
from pendbench.measures.energy import energy_balance, with_energy_checked
from pendbench.physics.acting import pivot_position
from pendbench.physics.geometry import positions
from pendbench.report.names import method_name
from pendbench.report.numbers import number_text
from pendbench.report.stage.records import Act, Body, Curve, Truth
from pendbench.report.stage.thinning import curve_drawn, moments_drawn, points_drawn
from pendbench.report.styles import Styles, is_hollow
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.truths import KeptTruth, compare, measure_truth
from pendbench.truth.solve import ENOUGH

#: The error, in lengths of the chain, from which on a run has left the truth.
LEFT: Final = 1e-2
#: The step of a method that has a fixed one where none is asked for, s; shorter where the scene is.
STEP_S: Final = 1e-3
_FEWEST_STEPS: Final = 1000
#: A chain of more links is long: stiff, and slow to compile for.
LONG: Final = 100
_FOR_LONG: Final = {"analytic": "frame"}
_STEP_FOR_LONG_S: Final = 1 / 240
#: A chain of more links is very long: no step is short enough for all of its motion, and nobody's truth reaches it.
VERY_LONG: Final = 1000
_FOR_VERY_LONG: Final = {"analytic": "bdf2"}  # moves well, with twice this step already: docs/measuring.md
_STEP_FOR_VERY_LONG_S: Final = 1 / 480
#: The longest chain that an engine is asked for by default, where a longer one takes minutes or gigabytes.
_LONGEST: Final = {"heyoka": LONG, "mujoco": VERY_LONG, "pymunk": VERY_LONG}
#: How many angles a run of a page keeps at most: those that are drawn need no more moments.
_MOST_ANGLES: Final = 10_000_000
#: What the truth of a page may cost, in steps times links: some seconds of work.
TRUTH_WORK: Final = 6e4


@dataclass(frozen=True, eq=False)
class Take:
    """A case and what became of it."""

    case: Case
    run: Trajectory


def default_cases(scene: Scene) -> list[Case]:
    """Every engine that runs unasked and can be loaded, with its first method.

    A long chain has other methods, that are done in time.
    """
    there = [name for name in engine_names() if not only_by_name(name) and _is_there(name)]
    if scene.n <= LONG:
        return [case_of(scene, name) for name in there]
    able = [_long_case(scene, name) for name in there if scene.n <= _LONGEST.get(name, scene.n)]
    return [case for case in able if scene.n <= VERY_LONG or _takes(case)]


def _takes(case: Case) -> bool:
    """Whether its engine does not refuse the scene."""
    return refusal(engine(case.engine), case.method, case.scene) is None


def _long_case(scene: Scene, name: str) -> Case:
    its, very = engine(name), scene.n > VERY_LONG
    methods, step = (_FOR_VERY_LONG, _STEP_FOR_VERY_LONG_S) if very else (_FOR_LONG, _STEP_FOR_LONG_S)
    method = methods.get(name, next(iter(its.methods)))
    return case_of(scene, name, method, None if its.methods[method].adaptive else step)


def _is_there(name: str) -> bool:
    try:
        engine(name)
    except MissingEngineError:
        return False
    return True


def case_of(scene: Scene, name: str, method: str | None = None, dt: float | None = None) -> Case:
    """A case with what is not said by default. Raises `InputError` for an engine or a method that there is not."""
    its = engine(name)
    chosen = next(iter(its.methods)) if method is None else method
    return Case(scene, name, chosen, _step(its, scene, chosen, dt))


def _step(its: Engine, scene: Scene, chosen: str, dt: float | None) -> float | None:
    known: Method | None = its.methods.get(chosen)
    if known is None or known.adaptive or dt is not None:
        return dt  # what makes no sense is refused by `simulate`, in its words
    return min(STEP_S, scene.duration / _FEWEST_STEPS)


def takes_of(cases: Sequence[Case]) -> list[Take]:
    """Run the cases, those with a fixed step first: the others are then recorded at the same times."""
    fixed = {case: _run(case, None) for case in cases if case.dt is not None}
    times = next((run.t for run in fixed.values() if len(run.t) > 1 and run.status == "ok"), None)
    return [Take(case, fixed[case] if case in fixed else _run(case, times)) for case in cases]


def _run(case: Case, times: FloatArray | None) -> Trajectory:
    times = _kept(case) if times is None else times
    found = simulate(case.scene, case.engine, case.method, case.dt, times, **dict(case.settings))
    with np.errstate(all="ignore"):
        return with_energy_checked(found, energy_balance(case.scene, found))


def _kept(case: Case) -> FloatArray | None:
    """When a run of a very long chain is kept, s; None for what `simulate` keeps of others."""
    scene, dt = case.scene, case.dt
    if scene.n <= VERY_LONG or dt is None:
        return None
    total = math.floor(scene.duration / dt * (1 + 1e-9))
    stride = max(1, -(-total * scene.n // _MOST_ANGLES))
    return np.asarray(np.unique(np.append(np.arange(0, total, stride), total)) * dt, np.float64)


def truth_of(scene: Scene, runs: Iterable[Trajectory], most_work: float = TRUTH_WORK) -> KeptTruth:
    """The truth at all the times of the runs, as far as so much work gets; `reference_within` says what work is.

    Of a very long chain there is none, unless as much work is asked for as it takes.
    """
    if scene.n > VERY_LONG and math.isfinite(most_work):
        return KeptTruth("refused", f"of more than {VERY_LONG} links it takes hours; --whole-truth computes it")
    times = reduce(np.union1d, [run.t for run in runs], np.zeros(1))
    return measure_truth(scene, np.asarray(times, np.float64), most_work)


def ghost(scene: Scene, truth: KeptTruth, bodies: int) -> Truth | None:
    """The truth as the stage shows it; None where there is none."""
    if not len(truth.t):
        return None
    kept = curve_drawn(truth.bound)
    bound = Curve(truth.t[kept], truth.bound[kept])
    ends = "the truth was computed up to here" if truth.reason == ENOUGH else "past here nobody knows"
    return Truth(body_of(scene, truth.t, truth.theta, bodies, ""), bound, truth.horizon, ends)


def body_of(scene: Scene, t: FloatArray, theta: FloatArray, bodies: int, colour: str) -> Body:
    """The points drawn of a chain, at the moments drawn. theta: (k, n) rad; bodies: how many share the page."""
    points = points_drawn(scene.n)
    moments = moments_drawn(len(t), len(points), bodies)
    with np.errstate(all="ignore"):
        places = positions(scene.lengths, theta[moments])
    pivot = pivot_position(scene, t[moments])[:, np.newaxis]
    return Body(t[moments], np.concatenate([pivot, pivot + places], axis=1)[:, points], colour)


def acts_of(takes: Sequence[Take], truth: KeptTruth) -> tuple[Act, ...]:
    """The takes with their colours and curves."""
    styles = Styles.of_cases([take.case for take in takes])
    return tuple(_act(take, truth, styles, len(takes) + 1) for take in takes)


def _act(take: Take, truth: KeptTruth, styles: Styles, bodies: int) -> Act:
    case, run = take.case, take.run
    colour = hex_colour(styles.colour(case))
    error = _error(case.scene, run, truth)
    moving = (body_of(case.scene, run.t, run.theta, bodies, colour),) if len(run.t) else ()
    return Act(
        name=case.engine,
        detail=_detail(case),
        colour=colour,
        bodies=moving,
        error=thinned(error),
        energy=thinned(Curve(run.t, energy_balance(case.scene, run).error)),
        dashes=_dashes(styles.stroke(case.dt)),
        hollow=is_hollow(case.engine),
        leaves=_leaves(error),
        ended="" if run.status == "ok" else _ended(Fault(run.status, run.reason)),
    )


def _detail(case: Case) -> str:
    step = "chooses its steps" if case.dt is None else f"step {number_text(case.dt)} s"
    return f"{method_name(case)}, {step}"


def _ended(fault: Fault) -> str:
    return printable(f"{fault.status}: {fault.reason}" if fault.reason else fault.status)


def _dashes(stroke: object) -> tuple[float, ...]:
    """Matplotlib's dashes, in widths of the line, as px."""
    return tuple(1.6 * width for width in stroke[1]) if isinstance(stroke, tuple) else ()


def hex_colour(colour: tuple[float, float, float]) -> str:
    """A colour for a page."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour)


def _error(scene: Scene, run: Trajectory, truth: KeptTruth) -> Curve:
    if not (len(run.t) and len(truth.t)):
        return Curve(np.zeros(0), np.zeros(0))
    with np.errstate(all="ignore"):
        found = compare(scene, run, truth)
    return Curve(found.t, found.error)


def _leaves(error: Curve) -> float:
    crossing = time_to(error.t, error.values, LEFT) if len(error.t) else None
    return math.nan if crossing is None else crossing.time


def thinned(curve: Curve) -> Curve:
    """What is drawn of a curve."""
    kept = curve_drawn(curve.values)
    return Curve(curve.t[kept], curve.values[kept])


def need_runs(takes: Sequence[Take]) -> None:
    """Raise `InputError` where there is nothing to see: no run has a moment."""
    if not any(len(take.run.t) for take in takes):
        said = "; ".join(f"{take.case.engine}: {_ended(Fault(take.run.status, take.run.reason))}" for take in takes)
        raise InputError(f"nothing moves: {said or 'no run was asked for'}")
