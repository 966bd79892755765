"""The tables of a study of kind `ensemble`: a row's values and its columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.kinds.ensemble.study import Compared, Energies, Found
from pendbench.kinds.ensemble.work import FlipRun
from pendbench.measures import flips as maps
from pendbench.measures.exponents import energy_shares, regular_below
from pendbench.measures.flips import Agreement, Flags, difference, pixel_angles
from pendbench.measures.symmetries import has_mirror_images, only_loses_energy
from pendbench.report import columns as common
from pendbench.report.columns import Column, Table, energy_drift, tables_of, text_column, within
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.study.results import Results

SUMMARY: Final = ("engine", "method", "dt", "chains", "chain_us", "pixels", "changed", "changed_away", "status")

_DIGITS: Final = 6  # of a flip time, s, in the map's table


@dataclass(frozen=True)
class CaseRow:
    """A case, its run, and how its pixels agree with the finest tolerance and with the map.

    is_truth: whether it is the finest itself.
    """

    case: Case
    run: FlipRun
    agrees: Agreement
    with_map: Agreement
    is_truth: bool

    @property
    def chains(self) -> int:
        """How many were run."""
        return len(self.run.flips)

    @property
    def lost(self) -> int:
        """How many of them could not be followed."""
        return int(np.isnan(self.run.flips).sum())

    @property
    def status(self) -> str:
        """How it ended."""
        return "work limit" if self.run.status == "ok" and self.lost else self.run.status

    @property
    def reason(self) -> str:
        """Why it did not end well."""
        if self.run.status == "ok" and self.lost:
            return f"{self.lost} of {self.chains} chains could not be followed"
        return self.run.reason

    @property
    def chain_us(self) -> float:
        """What a chain costs, us."""
        return self.run.run_s / self.chains * 1e6


@dataclass(frozen=True)
class MapRow:
    """The map in numbers: what it must show if it is right among them; nan for what effects leave open."""

    scene: Scene
    tolerance: float
    pixels: int
    pixels_failed: int
    pixels_at_edge: int
    never_share: float
    barred_share: float
    barred_flips: float
    mirror_largest_s: float


@dataclass(frozen=True)
class PixelRow:
    """A pixel at which a case was compared."""

    case: Case
    theta1_rad: float
    theta2_rad: float
    flip_s: float
    expected_flip_s: float
    is_at_edge: bool
    is_changed: bool


@dataclass(frozen=True)
class EnergyRow:
    """How the exponents of one bin of energies are spread: of those starts that could be followed."""

    energies: Energies
    chains: int
    quartiles: FloatArray
    regular_share: float


@dataclass(frozen=True)
class StartRow:
    """A start and its exponent."""

    energies: Energies
    theta1_rad: float
    theta2_rad: float
    energy_share: float
    lyapunov_per_s: float
    is_regular: bool


def _of_agreement(row: CaseRow, name: str) -> float | None:
    """Nothing is told of how the truth agrees with itself."""
    return None if row.is_truth else getattr(row.agrees, name)


_CHAINS: Final = Column("chains", "1", ",.0f", "chains", "how many chains were run, or could be followed")
_PIXELS: Final = (
    Column("pixels", "1", ",.0f", "pixels", "how many pixels of the map are compared (in maps.csv: it has)"),
    Column("pixels_failed", "1", ",.0f", "failed", "pixels whose flip time is not known, for a run failed"),
    Column(
        "pixels_at_edge", "1", ",.0f", "at the edge",
        "those of them at the map's edge, where a neighbour's flip time differs by more than is allowed",
    ),
)  # fmt: skip
_CASES: Final = (
    *common.CASE[:-1],
    *within("case", common.TOLERANCE),
    common.SETTINGS,
    *common.ENDING,
    # Every kind has these; a map of flips has no error that grows, and no price of a step.
    common.HORIZON.without("there is none"),
    common.ERROR_MAX.without("see changed"),
    *energy_drift("run"),
    common.STEP_US.without("see chain_us"),
    common.RUN.at(lambda row: row.run.run_s, "processor time for stepping all chains"),
    _CHAINS,
    _PIXELS[0].at(lambda row: row.agrees.pixels),
    _PIXELS[1].at(lambda row: row.agrees.failed),
    _PIXELS[2].at(lambda row: row.agrees.at_edge),
    Column(
        "changed", "1", ",.0f", "different",
        "pixels whose flip time differs by more than is allowed from that of the finest tolerance",
        partial(_of_agreement, name="changed"),
    ),
    Column(
        "changed_away", "1", ",.0f", "away from the edge", "those of the different pixels away from the map's edge",
        partial(_of_agreement, name="changed_away"),
    ),
    Column(
        "changed_from_map", "1", ",.0f", "not as the map",
        "pixels whose flip time differs from the map's, which has errors of its own", lambda row: row.with_map.changed,
    ),
    Column(
        "largest_away_s", "s", ".1e", "largest away, s",
        "the largest difference of flip times at pixels away from the map's edge",
        partial(_of_agreement, name="largest_away"),
    ),
    Column("chain_us", "us", ".3g", "chain, µs", "processor time for a chain: run_s over chains", is_time=True),
)  # fmt: skip
_MAPS: Final = (
    common.SCENE[0],
    common.TOLERANCE,
    common.DURATION,
    *_PIXELS,
    Column("never_share", "1", ".1%", "never", "the share of the map's chains that do not flip within the duration"),
    Column("barred_share", "1", ".1%", "cannot", "the share with less energy than the lowest state with a rod upright"),
    Column("barred_flips", "1", ",.0f", "yet do", "how many of these flip all the same"),
    Column(
        "mirror_largest_s", "s", ".1e", "mirror, s",
        "the largest difference between the map and that of the mirrored chains",
    ),
)  # fmt: skip
_THETA1: Final = Column("theta1_rad", "rad", ".4g", "θ1, rad", "the first angle at release")
_RELEASE: Final = (_THETA1, Column("theta2_rad", "rad", ".4g", "θ2, rad", "the second angle at release"))
_FLIP: Final = Column("flip_s", "s", ".4g", "flips at, s", "when a rod first goes over the top; infinite for never")
_COMPARED: Final = (
    *common.CASE[2:],
    *_RELEASE,
    _FLIP,
    Column(
        "expected_flip_s", "s", ".4g", "expected, s",
        "the flip time that it is compared with: that of the finest tolerance",
    ),
    text_column("is_at_edge", "at the edge", "whether the pixel is at the map's edge"),
    text_column("is_changed", "different", "whether the flip time differs from the expected by more than is allowed"),
)  # fmt: skip
_BIN: Final = (
    Column("energy_from", "1", ".2g", "energy from", "the lowest energy share of the starts", lambda r: r.energies.low),
    Column("energy_to", "1", ".2g", "to", "the energy share that they do not reach", lambda row: row.energies.high),
)
_ENERGIES: Final = (
    common.ENDING[0].at(lambda row: row.energies.run.status),
    common.ENDING[1].at(lambda row: row.energies.run.reason),
    _CHAINS,
    *_BIN,
    Column(
        "exponent_first_quartile_per_s", "1/s", ".3g", "exponent, first quartile, 1/s",
        "a quarter of these starts has a smaller Lyapunov exponent", lambda row: row.quartiles[0],
    ),
    Column(
        "exponent_median_per_s", "1/s", ".3g", "median, 1/s", "half of these starts have a smaller one",
        lambda row: row.quartiles[1],
    ),
    Column(
        "exponent_third_quartile_per_s", "1/s", ".3g", "third quartile, 1/s",
        "three quarters of these starts have a smaller one", lambda row: row.quartiles[2],
    ),
    Column("regular_share", "1", ".0%", "regular", "the share of these starts whose motion is regular"),
)  # fmt: skip
_STARTS: Final = (
    Column("lyapunov_per_s", "1/s", ".3g", "Lyapunov exponent, 1/s", "the rate at which neighbouring starts part"),
    *_RELEASE,
    *_BIN,
    Column("energy_share", "1", ".3g", "energy", "the energy at release: 0 for the hanging chain, 1 for the upright"),
    text_column("is_regular", "regular", "whether the exponent cannot be told from regular motion"),
)

#: The columns of every table, by its name.
COLUMNS: Final = {
    "cases": _CASES,
    "maps": _MAPS,
    "pixels": _COMPARED,
    "energies": _ENERGIES,
    "exponents": _STARTS,
}


def tables(results: Results[Found]) -> Sequence[Table]:
    """Every table of the study."""
    found, options = results.found, results.options
    allowed = options.changed * found.scene.duration
    edge = maps.edge_of(found.map, allowed)
    limit = regular_below(found.scene, options.exponents.seconds) if found.energies else math.nan
    return tables_of(
        {**COLUMNS, "map": tuple(_map_columns(len(found.map)))},
        {
            "cases": (_case_row(each, found, edge, allowed) for each in found.cases),
            "maps": [_map_row(found, edge, options.tolerance)],
            "map": np.column_stack([maps.grid_angles(len(found.map)), np.round(found.map, _DIGITS)]),
            "pixels": (row for each in found.cases for row in _pixels(each, edge, allowed)),
            "energies": (_energy_row(each, limit) for each in found.energies),
            "exponents": (row for each in found.energies for row in _starts(each, limit)),
        },
    )


def _case_row(each: Compared, found: Found, edge: Flags, allowed: float) -> CaseRow:
    at_edge, mapped = edge.ravel()[each.pixels], found.map.ravel()[each.pixels]
    agrees = maps.agreement(each.flips, each.expected, at_edge, allowed)
    with_map = maps.agreement(each.flips, mapped, at_edge, allowed)
    return CaseRow(each.case, each.run, agrees, with_map, each.case == found.finest)


def _map_row(found: Found, edge: Flags, tolerance: float) -> MapRow:
    flips, scene = found.map, found.scene
    known, barred = ~np.isnan(flips), _barred(scene, len(flips))
    mirror = difference(flips, maps.mirrored(flips)) if has_mirror_images(scene) else np.full(1, np.nan)
    bars = only_loses_energy(scene)
    return MapRow(
        scene=found.scene,
        tolerance=tolerance,
        pixels=int(known.sum()),
        pixels_failed=int((~known).sum()),
        pixels_at_edge=int(edge.sum()),
        never_share=float(np.isinf(flips).mean()),
        barred_share=float(barred.mean()) if bars else math.nan,
        barred_flips=int((np.isfinite(flips) & barred).sum()) if bars else math.nan,
        mirror_largest_s=float(np.nanmax(mirror)) if not np.isnan(mirror).all() else math.nan,
    )


def _barred(scene: Scene, count: int) -> Flags:
    """Which pixels (count, count) have less energy than the lowest state with a rod upright: they can never flip."""
    least = energy_shares(scene, math.pi * np.eye(scene.n)).min()
    shares = energy_shares(scene, pixel_angles(count, np.arange(count**2)))
    return np.asarray((shares < least).reshape(count, count))


def _map_columns(count: int) -> Iterator[Column]:
    """Of a table with a row for each theta_1: theta_1, and a column for each theta_2."""
    meaning = (
        "a flip time of the map, to a microsecond; inf for never. Its rows are for the first angles at release, its "
        "columns for the second ones, the same angles in the same order"
    )
    yield _THETA1.at(itemgetter(0))
    for at in range(count):
        yield Column(str(at), "s", ".4g", str(at), meaning, itemgetter(at + 1))


def _pixels(each: Compared, edge: Flags, allowed: float) -> Iterator[PixelRow]:
    changed = difference(each.flips, each.expected) > allowed
    values = *pixel_angles(len(edge), each.pixels).T, each.flips, each.expected, edge.ravel()[each.pixels], changed
    return (PixelRow(each.case, *row) for row in zip(*(own.tolist() for own in values), strict=True))


def _energy_row(each: Energies, limit: float) -> EnergyRow:
    """limit: below which an exponent is regular, 1/s."""
    known = each.run.exponents[np.isfinite(each.run.exponents)]
    quartiles = np.quantile(known, (0.25, 0.5, 0.75)) if len(known) else np.full(3, np.nan)
    return EnergyRow(each, len(known), quartiles, float((known < limit).mean()) if len(known) else math.nan)


def _starts(each: Energies, limit: float) -> Iterator[StartRow]:
    run = each.run
    values = *run.angles.T, run.shares, run.exponents, run.exponents < limit
    return (StartRow(each, *row) for row in zip(*(own.tolist() for own in values), strict=True))
