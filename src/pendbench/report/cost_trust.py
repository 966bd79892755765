"""What to distrust in a study of kind `cost`: odd results, and timings of runs that are too short."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from pendbench.report import sections
from pendbench.report.columns import duration_text
from pendbench.report.cost_series import without_tolerance
from pendbench.report.rows import Row, case_name, method_name, number, word
from pendbench.report.text import counted, markdown

#: Runs shorter than this, s, spend a visible share of their time on being called at all.
SHORT: Final = 1e-4
_LISTED: Final = 40
_OF_ALL_STEPS: Final = ("order ", "plateau")
_OF_TIMING: Final = ("noisy timing", "")


def odd(cases: Sequence[Row]) -> str:
    """Every flag that is not about timing, once for all steps where it is about all of them."""
    found = dict.fromkeys(f"{name}: {flag}" for row in cases for name, flag in _flags(row))
    if not found:
        return (
            "Nothing: no result is too good to be true, orders are those that are claimed, and errors fall with the "
            "step as far as they were followed."
        )
    return sections.bullets(found)


def _flags(row: Row) -> Iterator[tuple[str, str]]:
    series = without_tolerance(row)
    for flag in word(row, "flags").split("; "):
        if flag.partition(":")[0] in _OF_TIMING:
            continue
        of_all = flag.startswith(_OF_ALL_STEPS)
        name = f"{word(row, 'scene')}: {word(row, 'engine')} {method_name(series)}" if of_all else case_name(row)
        yield name, flag


def timings(cases: Sequence[Row]) -> Iterator[str]:
    """How far to trust them: their spread, and which of them are of runs too short to be told from a call."""
    yield sections.timing_trust(cases)
    short = sorted((row for row in cases if 0 < number(row, "run_s") < SHORT), key=lambda row: number(row, "run_s"))
    if not short:
        return
    limit = duration_text(SHORT)
    yield (
        f"{counted(len(short), 'case')} {'takes' if len(short) == 1 else 'take'} less than {limit} to the time of "
        "comparison. Entering an engine from Python once takes some microseconds of that, which no repetition takes "
        "away: it is what a caller pays for so short a run, and not what the steps of a long one cost. To compare "
        f"methods below {limit}, give their scene a later `time` in `[windows]` of the study's file."
    )
    names = [f"- {markdown(case_name(row))}: {duration_text(number(row, 'run_s'))}" for row in short[:_LISTED]]
    if len(short) > _LISTED:
        names.append(f"- and {len(short) - _LISTED} more, in `cases.csv`")
    yield "\n".join(names)
