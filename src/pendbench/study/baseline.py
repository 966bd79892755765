"""What a study found before, and whether it finds worse now. Times are never part of it.

A baseline is a CSV file beside the study: for each case its status, its error and its energy drift up to half of the
horizon, where chaos has not yet made numbers of rounding.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import pandas as pd

from pendbench.errors import InputError
from pendbench.files import write_whole
from pendbench.strict import shown_path
from pendbench.trajectory import STATUSES

_KEYS: Final = ("scene", "engine", "method", "dt", "settings")
#: What may grow, and the floor below which growth is rounding.
_FLOORS: Final = {"error_half": 1e-10, "energy_drift_half": 1e-12, "gap_max": 1e-9, "model_error": 1e-8}
#: How much larger a number may be than it was. Other processors and libraries round otherwise; half as much again is
#: no rounding.
_BAND: Final = 1.5


def baseline_path(study: Path, *, quick: bool) -> Path:
    """Where the baseline of a study file is."""
    return study.parent / "baselines" / f"{study.stem}{'.quick' if quick else ''}.csv"


def write_baseline(path: Path, cases: pd.DataFrame) -> None:
    """Keep what the cases show as the baseline."""
    columns = [*_KEYS, "status", *(name for name in _FLOORS if name in cases)]
    text = cases[columns].to_csv(index=False, float_format="%.6g", lineterminator="\n")
    write_whole(path, lambda file: file.write(text.encode()))


def read_baseline(path: Path) -> pd.DataFrame:
    """A baseline from its file. Raises `InputError`, one line, where it is missing or is none."""
    try:
        table = pd.read_csv(path, keep_default_na=True, dtype=dict.fromkeys(("settings", "scene", "status"), str))
    except FileNotFoundError:
        raise InputError(f"{shown_path(path)}: no baseline to check against; --update-baseline writes one") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{shown_path(path)}: not a baseline: {str(error).splitlines()[0][:120]}") from None
    missing = [name for name in (*_KEYS, "status") if name not in table]
    if missing:
        raise InputError(f"{shown_path(path)}: not a baseline: column {missing[0]!r} is missing")
    return table


def _key(row: pd.Series) -> tuple[object, ...]:
    dt = "" if pd.isna(row["dt"]) else f"{float(row['dt']):g}"
    settings = "" if pd.isna(row["settings"]) else str(row["settings"])
    return row["scene"], row["engine"], row["method"], dt, settings


def _name(row: pd.Series) -> str:
    scene, engine, method, dt, settings = _key(row)
    return " ".join(part for part in (scene, engine, method, dt and f"dt={dt}", settings) if part)  # type: ignore[misc]


def regressions(cases: pd.DataFrame, baseline: pd.DataFrame) -> list[str]:
    """What got worse, a line for each: scene, engine, method, number, before and now.

    A case of the baseline that was not run because its engine or scene was not asked for is no regression.
    """
    now = {_key(row): row for _, row in cases.iterrows()}
    asked = {(row["scene"], row["engine"]) for _, row in cases.iterrows()}
    found = []
    for _, before in baseline.iterrows():
        row = now.get(_key(before))
        if row is None:
            if (before["scene"], before["engine"]) in asked:
                found.append(f"{_name(before)}: in the baseline, but not run")
            continue
        found += _worse(_name(before), before, row)
    return found


def _worse(name: str, before: pd.Series, now: pd.Series) -> list[str]:
    found = []
    ranks = list(STATUSES)
    known = before["status"] if before["status"] in ranks else "ok"
    if ranks.index(now["status"]) > ranks.index(known):
        found.append(f"{name}: status was '{before['status']}', is '{now['status']}' ({now['reason']})")
    for column, floor in _FLOORS.items():
        if column not in before or column not in now or pd.isna(before[column]):
            continue
        allowed = max(_BAND * float(before[column]), floor)
        value = float(now[column])
        if math.isnan(value) or value > allowed:
            found.append(f"{name}: {column} was {before[column]:.3g}, is {value:.3g}; allowed up to {allowed:.3g}")
    return found
