"""The tables of a study of kind `league`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from pendbench.effects import names
from pendbench.kinds.league.rows import CaseRow, EngineRow, PairRow, case_rows, engine_rows, pair_rows, scene_rows
from pendbench.kinds.league.study import LEAVES, Found
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, energy_drift, tables_of, text_column, within
from pendbench.report.names import case_name
from pendbench.study.results import Results

SUMMARY: Final = ("scene", "engine", "method", "dt", "status", "follows_s", "error_max", "verdict", "as_it_comes")

#: What the terminal shows in place of the cases, which are thousands.
GLANCE: Final = (
    "engines",
    ("engine", "scenes", "standard_share", "best_share", "cost_s_per_s", "verdict"),
)

EFFECTS: Final = len(names()) + 1

_FOLLOWS: Final = Column(
    "follows_s", "s", ".3g", "on the truth, s",
    f"how long the error stays below {LEAVES:g} of the chain's length; up to the horizon, or the run's end, where it "
    "never passes it",
    lambda row: row.run.follows_s,
)  # fmt: skip
_EARLY: Final = Column(
    "error_early", "L", ".1e", "early error", "the largest e(t) up to the time for which an accuracy is asked",
    lambda row: row.run.error_early,
)  # fmt: skip
_COST: Final = Column(
    "cost_s_per_s", "s/s", ".2g", "cost, s per s",
    "time of one processor for a second of the scene; of what is run as it comes, and of the coarsest step of each "
    "method that is accurate enough",
    is_time=True,
)  # fmt: skip
_CASES: Final = (
    *common.CASE,
    *common.ENDING,
    common.HORIZON,
    common.ERROR_MAX.at(lambda row: row.run.error_max),
    _EARLY,
    _FOLLOWS,
    *energy_drift("run"),
    *within("run", common.GAP_MAX),
    text_column("verdict", "verdict", "whether the run was stable", lambda row: row.run.verdict),
    *within("run", common.STEPS),
    text_column("as_it_comes", "as it comes", "whether that is how the engine comes"),
    _COST,
    *within("timing", common.STEP_US, common.STEP_SPREAD, common.RUN),
)
_SCENES: Final = (
    *common.SCENE,
    common.TITLE,
    Column("known_s", "s", ".3g", "known until, s", "until when the truth is known, or the scene is run"),
    common.REFERENCE_ERROR.at(lambda row: row.truth.error),
    text_column("effects", "effects", "what acts on the chain", lambda row: ", ".join(row.scene.terms)),
)


def _part(name: str, of: Callable[[CaseRow], Any], empty: Any = math.nan) -> Callable[[PairRow], Any]:
    def value(row: PairRow) -> Any:
        own: CaseRow | None = getattr(row, name)
        return empty if own is None else of(own)

    return value


def _setting(name: str) -> Callable[[PairRow], Any]:
    return _part(name, lambda row: case_name(row.case, with_scene=False).partition(" ")[2], "")


_PAIRS: Final = (
    text_column("scene", "scene", "the scene's name"),
    text_column("engine", "engine", "the program that simulated"),
    Column("known_s", "s", ".3g", "known, s", "until when the truth is known"),
    text_column("standard", "as it comes", "method and step of who changes nothing", _setting("standard")),
    Column(
        "standard_follows_s", "s", ".3g", "on the truth, s", "as it comes",
        _part("standard", lambda row: row.run.follows_s),
    ),
    Column(
        "standard_energy", "energy scale", ".1e", "energy error", "as it comes",
        _part("standard", lambda row: row.run.energy_drift_max),
    ),
    Column(
        "standard_cost_s_per_s", "s/s", ".2g", "cost, s per s", "as it comes",
        _part("standard", lambda row: row.cost_s_per_s), is_time=True,
    ),
    text_column("best", "at its best", "method and step that follow the truth for longest", _setting("best")),
    Column(
        "best_follows_s", "s", ".3g", "on the truth, s", "at its best", _part("best", lambda row: row.run.follows_s)
    ),
    Column(
        "best_energy", "energy scale", ".1e", "energy error", "at its best",
        _part("best", lambda row: row.run.energy_drift_max),
    ),
    Column(
        "stable_dt", "s", ".2g", "largest stable step, s",
        "the largest step, of those tried with any method, with which energy and rods stay within 1 %",
        _part("stable", lambda row: row.case.dt),
    ),
    text_column("cheapest", "cheapest for the accuracy", "method and step", _setting("cheapest")),
    Column(
        "cost_s_per_s", "s/s", ".2g", "its cost, s per s", "time of one processor for a second of the scene",
        _part("cheapest", lambda row: row.cost_s_per_s), is_time=True,
    ),
    text_column("reason", "reason", "why the engine refuses the scene, or what became of it, or of the truth"),
)  # fmt: skip


def _shares(part: str) -> Callable[[EngineRow], float]:
    return lambda row: row.share(part)


def _energies(part: str) -> Callable[[EngineRow], float]:
    return lambda row: row.energy(part)


_ENGINES: Final = (
    text_column("engine", "engine", "the program that simulated"),
    text_column(
        "scenes", "scenes", "how many it simulates, of those in the study",
        lambda row: f"{len(row.taken)} of {len(row.pairs)}" if row.pairs else "",
    ),
    Column(
        "standard_share", "1", ".0%", "on the truth, as it comes",
        f"for how much of the known time of these scenes the error stays below {LEAVES:g} of the length, as it comes",
        _shares("standard"),
    ),
    Column("best_share", "1", ".0%", "at its best", "the same with the best method and step in each scene",
           _shares("best")),
    Column(
        "stable_dt", "s", ".2g", "largest stable step, s",
        "the largest step, of those tried, with which energy and rods stay within 1 %, in the median scene",
        empty="its own",
    ),
    Column(
        "cost_s_per_s", "s/s", ".2g", "cost of the accuracy, s per s",
        "time of one processor for a second, with the cheapest method and step that is accurate enough, in the median "
        "scene where one is",
        is_time=True,
    ),
    Column("ratio", "1", ".2g", "times the cheapest", "that cost over the cheapest engine's, in the median scene",
           is_time=True),
    text_column("reached", "reached in", "in how many scenes the accuracy is reached",
                lambda row: f"{len(row.reached)} of {len(row.taken)}" if row.taken else ""),
    Column("standard_energy", "energy scale", ".1e", "energy error, as it comes",
           "how far the energy strays as it comes, in the median scene; infinite: the runs do not reach their end",
           _energies("standard")),
    Column("best_energy", "energy scale", ".1e", "at its best", "the same at its best", _energies("best")),
    text_column("effects", "effects", "how many effects it simulates",
                lambda row: f"{row.effects} of {EFFECTS}" if row.pairs else ""),
    text_column("verdict", "verdict", "five words, by rule: docs/league.md"),
    Column("lines", "1", "d", "lines of code", "that a user of the engine writes for the challenge"),
    text_column("absent", "why not", "why the engine is not there, where it is not"),
)  # fmt: skip
#: The columns of every table, by its name.
COLUMNS: Final = {"cases": _CASES, "engines": _ENGINES, "engines_by_scene": _PAIRS, "scenes": _SCENES}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    found = results.found
    cases = list(case_rows(found))
    pairs = list(pair_rows(found, cases, results.options.error))
    rows: dict[str, Sequence[Any]] = {
        "cases": cases,
        "engines": engine_rows(pairs, found.absent),
        "engines_by_scene": pairs,
        "scenes": list(scene_rows(found)),
    }
    return tables_of(COLUMNS, rows)
