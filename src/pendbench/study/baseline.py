"""What a study found before, and whether it finds worse now. Times are never part of it.

A baseline is a CSV file beside the study: for each case its status, its verdict, its error and its energy drift, and
for its method the order that it shows and the largest step with which it is stable. Where a study compares up to the
horizon, that is up to half of it: later, chaos makes numbers of rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import describe
from pendbench.base.faults import STATUSES
from pendbench.base.files import write_whole
from pendbench.base.strict import input_error, shown_path
from pendbench.measures.verdict import rank
from pendbench.study.case_table import KEYS, case_key, case_text, is_nan, read_cases
from pendbench.study.changes import REPRODUCED, Measure, Range, told_by

if TYPE_CHECKING:
    import pandas as pd

#: Words that are better or worse.
_WORDS: Final = ("verdict",)


def baseline_path(study: Path, *, quick: bool) -> Path:
    """Where the baseline of a study file is."""
    return study.parent / "baselines" / f"{study.stem}{'.quick' if quick else ''}.csv"


def write_baseline(path: Path, cases: pd.DataFrame) -> None:
    """Keep what the cases show as the baseline."""
    words = [name for name in _WORDS if name in cases]
    columns = [*KEYS, "status", *words, *(measure.name for measure in told_by(cases.columns.tolist()))]
    text = cases[columns].to_csv(index=False, float_format="%.6g", lineterminator="\n")
    write_whole(path, lambda file: file.write(text.encode()))


def read_baseline(path: Path) -> pd.DataFrame:
    """A baseline from its file. Raises `InputError`, one line, where it is missing or is none."""
    where = shown_path(path)
    try:
        return read_cases(path, [measure.name for measure in REPRODUCED])
    except FileNotFoundError:
        raise input_error(where, "no baseline to check against; --update-baseline writes one") from None
    except (OSError, ValueError) as error:
        raise input_error(where, f"not a baseline: {describe(error)}") from None


def regressions(cases: pd.DataFrame, baseline: pd.DataFrame) -> list[str]:
    """What got worse, a line for each: scene, engine, method, number, before and now.

    A case of the baseline whose engine was not asked for is no regression; one that was not run for another reason is,
    and so is a case without a baseline, which nobody would notice getting worse.
    """
    now = {case_key(row): row for _, row in cases.iterrows()}
    asked, known = set(cases["engine"]), {case_key(row) for _, row in baseline.iterrows()}
    found = [f"{case_text(row)}: not in the baseline" for key, row in now.items() if key not in known]
    for _, before in baseline.iterrows():
        row = now.get(case_key(before))
        if row is None:
            if before["engine"] in asked:
                found.append(f"{case_text(before)}: in the baseline, but not run")
            continue
        found += _worse(before, row)
    return list(dict.fromkeys(found))


def _worse(before: pd.Series, now: pd.Series) -> list[str]:
    name, ranks = case_text(before), list(STATUSES)
    if "verdict" in before and "verdict" in now and rank(now["verdict"]) > rank(before["verdict"]):
        return [f"{name}: verdict was '{before['verdict']}', is '{now['verdict']}' ({now['reason']})"]
    if ranks.index(now["status"]) > ranks.index(before["status"]):
        return [f"{name}: status was '{before['status']}', is '{now['status']}' ({now['reason']})"]
    return [f"{case_text(before, with_step=not measure.of_method)}: {said}" for measure, said in _moved(before, now)]


def _moved(before: pd.Series, now: pd.Series) -> Iterator[tuple[Measure, str]]:
    """Each number that is where it may not be, and what to say of it."""
    for measure in REPRODUCED:
        column = measure.name
        if column not in before or column not in now or is_nan(before[column]):
            continue
        was, value = float(before[column]), float(now[column])
        if measure.moved(was, value):
            yield measure, f"{column} was {was:.3g}, is {value:.3g}; allowed {_said(measure.allowed(was))}"


def _said(allowed: Range) -> str:
    """From where to where, in words."""
    low, high = (f"{each:.3g}" for each in allowed)
    if math.isinf(allowed.low):
        return f"up to {high}"
    return f"from {low}" if math.isinf(allowed.high) else f"from {low} to {high}"
