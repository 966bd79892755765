"""The tables of a study of kind `ensemble`, from the flip times that it found."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from pendbench.arrays import FloatArray
from pendbench.engines.registry import engine
from pendbench.scene import Scene
from pendbench.study.case import Case
from pendbench.study.exponents import energy_shares, regular_below
from pendbench.study.flips import Flags, agreement, coarse_pixels, difference, grid_angles, mirrored, pixel_angles

Record = dict[str, Any]
Pixels = npt.NDArray[np.int64]

_DIGITS: Final = 6  # of a flip time, s, in the map's table


@dataclass(frozen=True)
class Energies:
    """The exponents of starts with energy shares from low to high: their arrays, None without, and how it went."""

    low: float
    high: float
    arrays: dict[str, FloatArray] | None
    record: Record


@dataclass(frozen=True)
class Findings:
    """map, edge (k, k): flip times, s, and the map's edge. flips: of each case at its own pixels; records: how it went.
    truth: of our finest tolerance, by whether the pixels are those of our cases.

    cases: ours, which run many chains at once, and the others. energies: none where the study does not ask.
    """

    scene: Scene
    options: Any
    cases: Sequence[Case]
    map: FloatArray
    edge: Flags
    flips: Mapping[Case, FloatArray]
    truth: Mapping[bool, FloatArray]
    records: Mapping[Case, Record]
    energies: Sequence[Energies]

    @property
    def allowed(self) -> float:
        """By how much flip times may differ, s."""
        return float(self.options.changed * self.scene.duration)

    def pixels_of(self, case: Case) -> Pixels:
        """The pixels at which a case is compared."""
        return sample_of(self.options) if is_ours(case) else coarse_pixels(self.options.grid, self.options.coarse)

    def expected(self, case: Case) -> FloatArray:
        """The flip times with which a case is compared."""
        return self.truth[is_ours(case)]


def is_ours(case: Case) -> bool:
    """Whether a case runs many chains at once."""
    return case.engine == "analytic" and case.method == "adaptive"


def tolerance_of(case: Case) -> float:
    """The tolerance of a case, the method's own where the study gives none; nan where there is no such setting."""
    setting = engine(case.engine).methods[case.method].settings.get("tolerance")
    value = None if setting is None else dict(case.settings).get("tolerance", setting.default)
    return math.nan if value is None else value


def finest_of(cases: Iterable[Case]) -> Case:
    """The one of ours with the finest tolerance."""
    return min((case for case in cases if is_ours(case)), key=tolerance_of)


def sample_of(options: Any) -> Pixels:
    """The pixels of the sample, in the map's order."""
    rng = np.random.default_rng(options.seed)
    return np.sort(rng.choice(options.grid**2, options.sample, replace=False))


def cases_table(found: Findings) -> pd.DataFrame:
    """A row for each case."""
    return pd.DataFrame([_case_row(found, case) for case in found.cases])


def other_tables(found: Findings) -> dict[str, pd.DataFrame]:
    """The map, the pixels that were compared, and the exponents."""
    exponents = [_exponent_table(found, each) for each in found.energies]
    return {
        "maps": pd.DataFrame([_map_row(found)]),
        "map": _map_table(found),
        "pixels": pd.concat([_pixel_table(found, case) for case in found.cases], ignore_index=True),
        "energies": pd.DataFrame([_energy_row(*both) for both in zip(found.energies, exponents, strict=True)]),
        "exponents": pd.concat([pd.DataFrame(), *exponents], ignore_index=True),
    }


def _case_row(found: Findings, case: Case) -> Record:
    record, pixels, is_truth = found.records[case], found.pixels_of(case), case == finest_of(found.cases)
    edge, mapped = found.edge.ravel()[pixels], found.map.ravel()[pixels]
    agrees = agreement(found.flips[case], found.expected(case), edge, found.allowed)
    is_map = is_ours(case) and tolerance_of(case) == found.options.tolerance
    flips = found.map.ravel() if is_map else np.concatenate([found.truth[True], found.truth[False]])
    flips = flips if is_map or is_truth else found.flips[case]
    chains, lost, run_s = len(flips), int(np.isnan(flips).sum()), record.get("run_s", math.nan)
    status, reason = record["status"], record["reason"]
    if status == "ok" and lost:
        status, reason = "work limit", f"{lost} of {chains} chains could not be followed"
    return {
        "scene": found.scene.name,
        "n": found.scene.n,
        "engine": case.engine,
        "method": case.method,
        "dt": math.nan if case.dt is None else case.dt,
        "settings": case.settings_text,
        "tolerance": tolerance_of(case),
        "status": status,
        "reason": reason,
        "chains": chains,
        "pixels": agrees.pixels,
        "pixels_failed": agrees.failed,
        "pixels_at_edge": agrees.at_edge,
        "changed": math.nan if is_truth else agrees.changed,
        "changed_away": math.nan if is_truth else agrees.changed_away,
        "changed_from_map": agreement(found.flips[case], mapped, edge, found.allowed).changed,
        "largest_away_s": math.nan if is_truth else agrees.largest_away,
        "horizon_s": math.nan,
        "error_max": math.nan,
        "energy_drift_max": record.get("energy_drift_max", math.nan),
        "step_us": math.nan,
        "chain_us": run_s / chains * 1e6,
        "run_s": run_s,
    }


def _map_row(found: Findings) -> Record:
    flips = found.map
    known, mirror = ~np.isnan(flips), difference(flips, mirrored(flips))
    compared = known & mirrored(known)
    barred = _barred(found.scene, len(flips))
    return {
        "scene": found.scene.name,
        "duration_s": found.scene.duration,
        "tolerance": found.options.tolerance,
        "pixels": int(known.sum()),
        "pixels_failed": int((~known).sum()),
        "pixels_at_edge": int(found.edge.sum()),
        "never_share": float(np.isinf(flips).mean()),
        "barred_share": float(barred.mean()),
        "barred_flips": int((np.isfinite(flips) & barred).sum()),
        "mirror_largest_s": float(mirror[compared].max()) if compared.any() else math.nan,
    }


def _barred(scene: Scene, count: int) -> Flags:
    """Which pixels (count, count) have less energy than the lowest state with a rod upright: they can never flip."""
    least = energy_shares(scene, math.pi * np.eye(scene.n)).min()
    shares = energy_shares(scene, pixel_angles(count, np.arange(count**2)))
    return np.asarray((shares < least).reshape(count, count))


def _map_table(found: Findings) -> pd.DataFrame:
    """A row for each theta_1, a column for each theta_2."""
    columns = {str(number): column for number, column in enumerate(np.round(found.map, _DIGITS).T)}
    return pd.DataFrame({"theta1_rad": grid_angles(len(found.map)), **columns})


def _pixel_table(found: Findings, case: Case) -> pd.DataFrame:
    pixels, expected = found.pixels_of(case), found.expected(case)
    angles = pixel_angles(found.options.grid, pixels)
    return pd.DataFrame(
        {
            "engine": case.engine,
            "method": case.method,
            "dt": math.nan if case.dt is None else case.dt,
            "settings": case.settings_text,
            "theta1_rad": angles[:, 0],
            "theta2_rad": angles[:, 1],
            "flip_s": found.flips[case],
            "expected_flip_s": expected,
            "is_at_edge": found.edge.ravel()[pixels],
            "is_changed": difference(found.flips[case], expected) > found.allowed,
        }
    )


def _exponent_table(found: Findings, energies: Energies) -> pd.DataFrame:
    arrays = energies.arrays
    if arrays is None:
        return pd.DataFrame()
    return pd.DataFrame(
        {
            "energy_from": energies.low,
            "energy_to": energies.high,
            "theta1_rad": arrays["angles"][:, 0],
            "theta2_rad": arrays["angles"][:, 1],
            "energy_share": arrays["shares"],
            "lyapunov_per_s": arrays["exponents"],
            "is_regular": arrays["exponents"] < regular_below(found.scene, found.options.exponents.seconds),
        }
    )


def _energy_row(energies: Energies, exponents: pd.DataFrame) -> Record:
    """The distribution of the exponents in one bin of energies."""
    rates = np.zeros(0) if energies.arrays is None else energies.arrays["exponents"]
    known = np.isfinite(rates)
    quartiles = np.quantile(rates[known], (0.25, 0.5, 0.75)) if known.any() else np.full(3, np.nan)
    return {
        "energy_from": energies.low,
        "energy_to": energies.high,
        "status": energies.record["status"],
        "reason": energies.record["reason"],
        "chains": int(known.sum()),
        "exponent_first_quartile_per_s": quartiles[0],
        "exponent_median_per_s": quartiles[1],
        "exponent_third_quartile_per_s": quartiles[2],
        "regular_share": float(exponents["is_regular"][known].mean()) if known.any() else math.nan,
    }
