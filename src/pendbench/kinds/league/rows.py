"""What became of each case, of each engine in each scene, and of each engine in all."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pendbench.effects import names
from pendbench.engines.protocol import mapped_effects
from pendbench.engines.registry import engine
from pendbench.kinds.league.settings import engine_file
from pendbench.kinds.league.study import Found, coarsest_enough
from pendbench.kinds.league.verdicts import verdict
from pendbench.kinds.league.work import LeagueRun
from pendbench.report.names import OfRun, OfTruth, finite, grouped
from pendbench.scene.links import LINKS
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.timing import UNTIMED, Timed
from pendbench.study.truths import KeptTruth


@dataclass(frozen=True)
class SceneRow(OfTruth):
    """A scene, its truth, and until when that is known, s."""

    scene: Scene
    truth: KeptTruth
    known_s: float


@dataclass(frozen=True)
class CaseRow(OfRun):
    """A case. as_it_comes: whether that is how its engine comes."""

    case: Case
    run: LeagueRun
    horizon_s: float
    as_it_comes: bool
    timing: Timed

    @property
    def cost_s_per_s(self) -> float:
        """Seconds of one processor for a second of the scene."""
        return 1.0 / self.timing.simulated_s_per_s


@dataclass(frozen=True)
class PairRow:
    """An engine in a scene: as it comes, with what follows the truth for longest, the largest step that holds, and the
    cheapest that is accurate enough; each None where there is none. known_s: how long the truth is known.
    """

    scene: str
    engine: str
    known_s: float
    standard: CaseRow | None
    best: CaseRow | None
    stable: CaseRow | None
    cheapest: CaseRow | None
    reason: str = ""

    @property
    def is_refused(self) -> bool:
        """Whether none of its methods simulates the scene."""
        return self.best is None


@dataclass(frozen=True)
class EngineRow:
    """An engine in all scenes that it simulates. absent: why it is not there at all, else empty.

    ratio: how many times the cheapest engine's cost its own is, in the median scene in which it is accurate enough.
    effects: how many of all it simulates. lines: that a user of it writes for the challenge.
    """

    engine: str
    pairs: Sequence[PairRow]
    ratio: float = math.nan
    effects: int = 0
    lines: float = math.nan
    absent: str = ""

    @property
    def status(self) -> str:
        """Whether it is there."""
        return "error" if self.absent else "ok"

    @property
    def taken(self) -> Sequence[PairRow]:
        """The scenes that it simulates."""
        return [pair for pair in self.pairs if not pair.is_refused]

    def share(self, part: str) -> float:
        """For how much of the known time it follows the truth, 0 to 1: as `standard` or at its `best`."""
        known = [pair for pair in self.taken if pair.known_s > 0]
        followed = [finite([row.run.follows_s]) for pair in known if (row := getattr(pair, part)) is not None]
        total = sum(pair.known_s for pair in known)
        return sum(map(sum, followed)) / total if total > 0 else math.nan

    def energy(self, part: str) -> float:
        """The energy's error in the median scene; infinite where a run has none."""
        errors = [_energy(getattr(pair, part)) for pair in self.taken]
        return float(np.median(errors)) if errors else math.nan

    @property
    def reached(self) -> Sequence[PairRow]:
        """The scenes in which it is accurate enough."""
        return [pair for pair in self.taken if pair.cheapest is not None]

    @property
    def cost_s_per_s(self) -> float:
        """What the accuracy costs, s per s, in the median scene in which it is reached."""
        costs = finite(pair.cheapest.cost_s_per_s for pair in self.reached if pair.cheapest is not None)
        return float(np.median(costs)) if costs else math.nan

    @property
    def stable_dt(self) -> float:
        """The largest step that holds, s, in the median scene that some step holds."""
        steps = finite(pair.stable.case.dt for pair in self.taken if pair.stable is not None)
        return float(np.median(steps)) if steps else math.nan

    @property
    def verdict(self) -> str:
        """Five words, or why there are none."""
        if self.absent or not self.taken:
            return f"not here: {self.absent}" if self.absent else "takes none of these scenes"
        enough = self.ratio if 2 * len(self.reached) >= len(self.taken) else math.nan
        return verdict(self.share("best"), enough, self.energy("standard"))


def _energy(row: CaseRow | None) -> float:
    """How far the energy of a run strays; infinite where the run did not come to its end."""
    if row is None or row.status not in ("ok", "energy lost") or not row.run.energy_drift_max >= 0:
        return math.inf
    return row.run.energy_drift_max


def scene_rows(found: Found) -> Iterator[SceneRow]:
    """A row for each scene."""
    for scene in found.scenes:
        truth = found.truths[scene.name]
        yield SceneRow(scene, truth, truth.horizon if truth.horizon > 0 else 0.0)


def case_rows(found: Found) -> Iterator[CaseRow]:
    """A row for each case."""
    for case, run in found.runs.items():
        horizon = found.truths[case.scene.name].horizon
        yield CaseRow(case, run, horizon, case in found.standard, found.timings.get(case, UNTIMED))


def pair_rows(found: Found, cases: Sequence[CaseRow], goal: float) -> Iterator[PairRow]:
    """A row for each scene and engine."""
    scenes = {row.scene.name: row for row in scene_rows(found)}
    for (scene, name), own in grouped(cases, lambda row: (row.case.scene.name, row.case.engine)).items():
        able = [row for row in own if row.status != "refused"]
        standard = next((row for row in own if row.as_it_comes), None)
        yield PairRow(
            scene=scene,
            engine=name,
            known_s=scenes[scene].known_s,
            standard=standard,
            best=max(able, key=_goodness, default=None),
            stable=max((row for row in able if _holds(row)), key=lambda row: row.case.dt or 0.0, default=None),
            cheapest=_cheapest(able, goal),
            reason=_why(own, standard, scenes[scene].truth),
        )


def _goodness(row: CaseRow) -> tuple[float, float, float, float]:
    """The longest on the truth first; of those to its end, the most exact; where no truth is known, the steadiest."""
    follows, error = row.run.follows_s, row.run.error_max
    whole = follows if follows >= 0 else -1.0
    return whole, -error if error >= 0 else -math.inf, -_energy(row), row.case.dt or 0.0


def _why(own: Sequence[CaseRow], standard: CaseRow | None, truth: KeptTruth) -> str:
    """Why an engine has no numbers in a scene, or some are missing."""
    if all(row.status == "refused" for row in own):
        return own[0].reason
    late = "" if truth.horizon > 0 else f"no truth: {truth.status}"
    failed = "" if standard is None or standard.status == "ok" else f"as it comes: {standard.status}: {standard.reason}"
    return "; ".join(text for text in (failed, late) if text)


def _holds(row: CaseRow) -> bool:
    return row.case.dt is not None and row.run.verdict == "holds"


def _cheapest(rows: Sequence[CaseRow], goal: float) -> CaseRow | None:
    """Of the coarsest of each method that is accurate enough, the cheapest; the coarsest where none could be timed."""
    by_case = {row.case: row for row in rows}
    methods = grouped(by_case, lambda case: case.without_step.without_tolerance).values()
    enough = (coarsest_enough({case: by_case[case].run for case in own}, goal) for own in methods)
    return min((by_case[case] for case in enough if case), key=_cost, default=None)


def _cost(row: CaseRow) -> float:
    cost = row.cost_s_per_s
    return cost if cost > 0 else math.inf


def engine_rows(pairs: Sequence[PairRow], absent: Mapping[str, str]) -> list[EngineRow]:
    """A row for each engine, the best first; those that are not there last."""
    by_engine = grouped(pairs, lambda pair: pair.engine)
    rows = [EngineRow(name, own, effects=_effects(name), lines=lines_of(name)) for name, own in by_engine.items()]
    ranked = sorted(rows_with_ratios(rows), key=_place)
    return [*ranked, *(EngineRow(name, (), lines=lines_of(name), absent=why) for name, why in absent.items())]


def rows_with_ratios(rows: Sequence[EngineRow]) -> list[EngineRow]:
    """The rows, each with its cost over that of the cheapest of them, in the median scene."""
    cheapest: dict[str, float] = {}
    for row in rows:
        for pair in row.reached:
            if pair.cheapest is not None:
                cheapest[pair.scene] = min(cheapest.get(pair.scene, math.inf), _cost(pair.cheapest))
    return [replace(row, ratio=_ratio(row, cheapest)) for row in rows]


def _ratio(row: EngineRow, cheapest: Mapping[str, float]) -> float:
    timed = [pair for pair in row.reached if cheapest[pair.scene] > 0]
    ratios = finite(_cost(pair.cheapest) / cheapest[pair.scene] for pair in timed if pair.cheapest)
    return float(np.median(ratios)) if ratios else math.nan


def _place(row: EngineRow) -> tuple[float, float]:
    """Longest on the truth at its best first; of equals the cheapest."""
    share = row.share("best")
    return -round(share, 2) if share >= 0 else 1.0, row.ratio if row.ratio > 0 else math.inf


def _effects(name: str) -> int:
    known = mapped_effects(engine(name))
    return sum(effect in known and not known[effect].refused for effect in (*names(), LINKS))


def lines_of(name: str) -> float:
    """How many lines of code a user writes for the challenge: those of the engine's snippet that are neither empty nor
    a comment; nan where there is none.
    """
    found = engine_file(name)
    if found is None or found[1].snippet is None:
        return math.nan
    lines = (line.strip() for line in found[1].snippet.splitlines())
    return sum(bool(line) and not line.startswith("#") for line in lines)
