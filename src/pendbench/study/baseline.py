"""What a study found before, and whether it finds worse now. Times are never part of it.

A baseline is a CSV file beside the study: for each case its status, its verdict, its error and its energy drift, and
for its method the order that it shows and the largest step with which it is stable. Where a study compares up to the
horizon, that is up to half of it: later, chaos makes numbers of rounding.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Final

import pandas as pd

from pendbench.errors import choose, describe, printable
from pendbench.files import write_whole
from pendbench.strict import input_error, shown_path
from pendbench.study.verdict import VERDICTS, rank
from pendbench.trajectory import STATUSES

_KEYS: Final = ("scene", "engine", "method", "dt", "settings")
#: What may grow, and the floor below which growth is rounding.
_FLOORS: Final = {
    "error_half": 1e-10,
    "energy_drift_half": 1e-12,
    "error_max": 1e-12,
    "energy_drift_max": 1e-12,
    "balance_error": 1e-10,
    "gap_max": 1e-9,
    "model_error": 1e-8,
}
#: Numbers for studies that do not have the other ones.
_INSTEAD: Final = {"error_max": "error_half", "energy_drift_max": "energy_drift_half"}
#: What is as bad where it falls as where it grows, and by how much it may differ. It is of all the steps of a method.
_STAYS: Final = {"order_observed": 0.2}
#: What may grow but not shrink: to this share of what it was. It is of all the steps of a method.
_SHRINKS: Final = {"stable_dt": 0.8}
#: Words that are better or worse.
_WORDS: Final = ("verdict",)
#: How much larger a number may be than it was. Other processors and libraries round otherwise; half as much again is
#: no rounding.
_BAND: Final = 1.5


def baseline_path(study: Path, *, quick: bool) -> Path:
    """Where the baseline of a study file is."""
    return study.parent / "baselines" / f"{study.stem}{'.quick' if quick else ''}.csv"


def write_baseline(path: Path, cases: pd.DataFrame) -> None:
    """Keep what the cases show as the baseline."""
    # Where a verdict says how large an error is, runs that broke would only add numbers of chance.
    judged = "verdict" in cases
    numbers = [name for name in _FLOORS if name in cases and not judged and _INSTEAD.get(name) not in cases]
    words = [name for name in _WORDS if name in cases]
    columns = [*_KEYS, "status", *words, *numbers, *(name for name in (*_STAYS, *_SHRINKS) if name in cases)]
    text = cases[columns].to_csv(index=False, float_format="%.6g", lineterminator="\n")
    write_whole(path, lambda file: file.write(text.encode()))


def read_baseline(path: Path) -> pd.DataFrame:
    """A baseline from its file. Raises `InputError`, one line, where it is missing or is none."""
    where = shown_path(path)
    try:
        return _read(path)
    except FileNotFoundError:
        raise input_error(where, "no baseline to check against; --update-baseline writes one") from None
    except (OSError, ValueError, pd.errors.ParserWarning) as error:
        raise input_error(where, f"not a baseline: {describe(error)}") from None


def _read(path: Path) -> pd.DataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # lines longer than the heading
        table = pd.read_csv(path, dtype=str, keep_default_na=False, index_col=False)
    for name in (*_KEYS, "status"):
        if name not in table:
            raise ValueError(f"column {name!r} is missing")
    for name in ("dt", *_FLOORS, *_STAYS, *_SHRINKS):
        if name in table:
            table[name] = pd.to_numeric(table[name].where(table[name] != ""))
    for status in table["status"]:
        if status not in STATUSES:
            raise ValueError(choose("status", printable(str(status)), STATUSES))
    for verdict in table.get("verdict", ()):
        if verdict not in VERDICTS:
            raise ValueError(choose("verdict", printable(str(verdict)), VERDICTS))
    return table


def _key(row: pd.Series) -> tuple[object, ...]:
    dt = "" if pd.isna(row["dt"]) else f"{float(row['dt']):g}"
    settings = "" if pd.isna(row["settings"]) else str(row["settings"])
    return row["scene"], row["engine"], row["method"], dt, settings


def _name(row: pd.Series, *, with_step: bool = True) -> str:
    scene, engine, method, dt, settings = _key(row)
    step = f"dt={dt}" if dt and with_step else ""
    return " ".join(part for part in (scene, engine, method, step, settings) if part)  # type: ignore[misc]


def regressions(cases: pd.DataFrame, baseline: pd.DataFrame) -> list[str]:
    """What got worse, a line for each: scene, engine, method, number, before and now.

    A case of the baseline whose engine was not asked for is no regression; one that was not run for another reason is,
    and so is a case without a baseline, which nobody would notice getting worse.
    """
    now = {_key(row): row for _, row in cases.iterrows()}
    asked, known = set(cases["engine"]), {_key(row) for _, row in baseline.iterrows()}
    found = [f"{_name(row)}: not in the baseline" for key, row in now.items() if key not in known]
    for _, before in baseline.iterrows():
        row = now.get(_key(before))
        if row is None:
            if before["engine"] in asked:
                found.append(f"{_name(before)}: in the baseline, but not run")
            continue
        found += _worse(before, row)
    return list(dict.fromkeys(found))


def _worse(before: pd.Series, now: pd.Series) -> list[str]:
    name, ranks = _name(before), list(STATUSES)
    if "verdict" in before and "verdict" in now and rank(now["verdict"]) > rank(before["verdict"]):
        return [f"{name}: verdict was '{before['verdict']}', is '{now['verdict']}' ({now['reason']})"]
    if ranks.index(now["status"]) > ranks.index(before["status"]):
        return [f"{name}: status was '{before['status']}', is '{now['status']}' ({now['reason']})"]
    found = []
    for column, floor in _FLOORS.items():
        if column not in before or column not in now or pd.isna(before[column]):
            continue
        allowed = max(_BAND * float(before[column]), floor)
        value = float(now[column])
        if not value <= allowed:
            found.append(f"{name}: {column} was {before[column]:.3g}, is {value:.3g}; allowed up to {allowed:.3g}")
    return found + _moved(before, now) + _shrunk(before, now)


def _moved(before: pd.Series, now: pd.Series) -> list[str]:
    """What should have stayed where it was; one line for all the steps of a method."""
    found, name = [], _name(before, with_step=False)
    for column, most in _STAYS.items():
        if column not in before or column not in now or pd.isna(before[column]):
            continue
        was, value = float(before[column]), float(now[column])
        if not abs(value - was) <= most:
            low, high = was - most, was + most
            found.append(f"{name}: {column} was {was:.3g}, is {value:.3g}; allowed from {low:.3g} to {high:.3g}")
    return found


def _shrunk(before: pd.Series, now: pd.Series) -> list[str]:
    """What should not have become smaller; one line for all the steps of a method."""
    found, name = [], _name(before, with_step=False)
    for column, share in _SHRINKS.items():
        if column not in before or column not in now or pd.isna(before[column]):
            continue
        was, value = float(before[column]), float(now[column])
        if not value >= share * was:
            found.append(f"{name}: {column} was {was:.3g}, is {value:.3g}; allowed from {share * was:.3g}")
    return found
