"""What the study `judge` runs in worker processes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray, largest
from pendbench.engines.recording import simulate
from pendbench.measures.divergence import time_to
from pendbench.measures.energy import Balance, energy_balance, times_to_balance, with_energy_checked
from pendbench.measures.model_error import model_error
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.models import Model
from pendbench.study.runs import run_unstopped
from pendbench.study.truths import KeptTruth, compare

#: Where a small error has grown by this factor, no engine is asked to go on unless somebody wants it.
MAGNIFIED: Final = 1e3

#: Why a span ends where its truth does.
TRUTH_ENDS: Final = "the truth"

_SAMPLES: Final = 1000
_APART: Final = 1e-8  # rad, of a neighbour: large beside what `adaptive` errs by, small after growing by `MAGNIFIED`
_FEWEST: Final = 20  # samples that are compared
SEED: Final = 1  # of the states in which accelerations are compared
_WELL_KNOWN: Final = 0.1  # an imbalance is worth a number if its samples tell it to this share


@dataclass(frozen=True)
class Span:
    """How long a scene is followed, until (s), with samples every `interval` (s), and why no longer.

    magnified: by how much a small error grows until then, at the most.
    """

    status: str
    reason: str = ""
    until: float = math.nan
    interval: float = math.nan
    magnified: float = math.nan
    why: str = ""


@dataclass(frozen=True)
class File:
    """A model file that is run as it stands. digest: of its content and of all that it includes. timestep: s."""

    path: str
    digest: str
    integrator: str
    timestep: float
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Try:
    """How a run went; nan for what could not be measured.

    follows_s: for how long its error stays below the goal, s; all of the span where `stays`. error_max: nan where the
    run, or the truth, does not reach the end of the span. energy: how far its energy is from where it should be.
    """

    status: str
    reason: str = ""
    steps: int | None = None
    error_max: float = math.nan
    follows_s: float = math.nan
    stays: bool = False
    energy: float = math.nan
    gap_max: float = math.nan


def measure_span(scene: Scene, asked: float | None) -> Span:
    """How long the scene is to be followed: as long as asked for; else to its end, or to where chaos has its say."""
    times = np.linspace(0.0, asked or scene.duration, _SAMPLES + 1)
    run = simulate(scene, method="adaptive", times=times)
    beside = simulate(scene.with_start(scene.angles + _APART, scene.rates), method="adaptive", times=times)
    k = min(len(run.t), len(beside.t))
    if k < 2:
        return Span(run.status, run.reason)
    apart = distance(scene.lengths, run.theta[:k], beside.theta[:k] - run.theta[:k])
    grown = np.maximum.accumulate(apart) / apart[0]
    if asked:
        return _span(asked, times[:k], grown, "as asked for")
    over = np.flatnonzero(grown > MAGNIFIED)
    if over.size:
        return _span(float(times[over[0]]), times[:k], grown, "chaos")
    return _span(float(times[k - 1]), times[:k], grown, "the scene's end")


def _span(until: float, times: FloatArray, grown: FloatArray, why: str) -> Span:
    """A whole number of intervals, each a power of ten."""
    interval = float(f"1e{math.floor(math.log10(until / _FEWEST) + 1e-9)}")
    until = math.floor(until / interval + 1e-6) * interval
    return Span("ok", "", until, interval, float(grown[times <= until * (1 + 1e-9)][-1]), why)


def within_truth(span: Span, truth: KeptTruth) -> Span:
    """As much of a span as the truth is known for; until is nan where that is none of it."""
    known = math.floor(truth.horizon / span.interval + 1e-6) if truth.horizon > 0 else 0
    if known >= round(span.until / span.interval):
        return span
    return replace(span, until=known * span.interval if known else math.nan, why=TRUTH_ENDS)


def compared_times(span: Span) -> FloatArray:
    """The times (k,) s at which runs are compared with the truth."""
    return np.asarray(np.arange(round(span.until / span.interval) + 1) * span.interval)


def measure_try(case: Case, times: FloatArray, goal: float, truth: KeptTruth | None) -> Try:
    """Run the case and compare it with the truth at `times` (k,) s."""
    asked = times if case.dt is None else times_to_balance(case.scene, case.dt, times)
    return _compared(case.scene, run_unstopped(case, asked), times, goal, truth)


def _compared(scene: Scene, run: Trajectory, times: FloatArray, goal: float, truth: KeptTruth | None) -> Try:
    balance = energy_balance(scene, run)
    run = with_energy_checked(run, balance)
    found = Try(run.status, run.reason, run.steps, energy=_strays(balance), gap_max=largest(run.gap))
    if truth is None or not len(truth.t) or not len(run.t):
        return found
    compared = compare(scene, run, truth)
    crossing = time_to(compared.t, compared.error, goal)
    whole = run.status == "ok" and bool(len(compared.t)) and compared.t[-1] >= times[-1]
    return replace(
        found,
        error_max=largest(compared.error) if whole else math.nan,
        follows_s=crossing.time if crossing else float(compared.t[-1]),
        stays=whole and crossing is None,
    )


def read_file(path: str) -> File:
    """A model file, read. Raises `InputError` where it is none, or no chain."""
    from pendbench.scene.models.read import read_model

    model = read_model(path)
    return File(path, model.digest, model.integrator, model.timestep, model.notes)


def _strays(balance: Balance) -> float:
    """How far the energy is astray; nan where the samples do not tell what damping and drives leave of it."""
    found = largest(np.abs(balance.error))
    return math.nan if balance.works and not balance.known_to <= _WELL_KNOWN * found else found


def file_times(span: Span, timestep: float) -> FloatArray:
    """The times (k,) s at which a file is compared: those of the others, each on a whole step of its own, the first
    step among them where all of the span is shorter.
    """
    whole = np.unique(np.rint(compared_times(span) / timestep))
    return np.asarray((whole if len(whole) > 1 else np.array([0.0, 1.0])) * timestep)


def measure_file(file: File, scene: Scene, times: FloatArray, goal: float, truth: KeptTruth | None) -> Try:
    """Run a model file as it stands and compare it with the truth at `times` (k,) s."""
    from pendbench.engines.mujoco.model_file import ModelFile

    asked = times_to_balance(scene, file.timestep, times)
    run = simulate(scene, ModelFile(file.path), dt=file.timestep, times=asked)
    return _compared(scene, run, times, goal, truth)


def measure_file_model(file: File, scene: Scene) -> Model:
    """How far the accelerations of a model file are from the equations'."""
    from pendbench.engines.mujoco.model_file import AS_IT_STANDS, ModelFile

    return Model("ok", "", *model_error(ModelFile(file.path), scene, AS_IT_STANDS, {}, SEED))
