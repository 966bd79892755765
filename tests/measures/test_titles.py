"""What long chains win, by runs that are made up: each is judged by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pendbench.measures.coarse_motion import CoarseErrors
from pendbench.measures.titles import TITLES, Shown, title_of

#: Ten seconds in two, the energy off by 0.1 %, and by 0.1 % of the length at most from the motion, afar and near.
GOOD = Shown(10.0, 10.0, 2.0, strays=1e-3, error=1e-3, coarse=CoarseErrors(1e-3, 1e-3, 1e-3))


def judged(**changes):
    return tuple(title.judge(replace(GOOD, **changes)).outcome for title in TITLES)


def test_titles_are_in_this_order():
    assert [title.name for title in TITLES] == ["faithful", "energy", "moves well"]
    assert title_of("energy") is TITLES[1]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ("held", "held", "held")),
        ({"strays": 0.24, "lost": 0.24}, ("lost", "lost", "held")),  # damps
        ({"strays": 0.24, "lost": 0.24, "risen": 0.011}, ("lost", "lost", "lost")),
        ({"strays": 0.009, "risen": 0.009}, ("held", "held", "held")),
        ({"error": 0.0101}, ("lost", "held", "held")),
        ({"coarse": CoarseErrors(0.001, 0.021, 0.001)}, ("held", "held", "lost")),
        ({"gap": 0.011}, ("lost", "lost", "lost")),
        ({"fault": "warned: wobbly", "reached": 3.0}, ("lost", "lost", "lost")),
        ({"strays": math.nan, "risen": math.nan, "reached": 3.0}, ("lost", "lost", "lost")),
        ({"spent": 10.1, "reached": 7.0}, ("too slow", "too slow", "too slow")),
        ({"spent": 10.1, "reached": 7.0, "strays": 0.5}, ("lost", "lost", "too slow")),
        ({"reached": 7.0}, ("unfinished", "unfinished", "unfinished")),
        ({"reached": 7.0, "error": 0.5}, ("lost", "unfinished", "unfinished")),
        ({"error": math.nan}, ("not known", "held", "held")),
        ({"coarse": CoarseErrors()}, ("held", "held", "not known")),
        ({"error": math.nan, "spent": 10.1}, ("too slow", "too slow", "too slow")),
    ],
)
def test_a_run_wins_what_it_has_shown(changes, expected):
    assert judged(**changes) == expected


@pytest.mark.parametrize(
    ("changes", "reasons"),
    [
        ({"spent": 10.25, "reached": 7.0}, ["7 s of motion took 10.2 s"] * 3),
        ({"error": 0.5}, ["off by 0.5 of the length while the motion can be predicted", "", ""]),
        ({"strays": 0.24}, ["the energy strays by 0.24 of its scale"] * 2 + [""]),
        ({"fault": "torn: at the pivot"}, ["torn: at the pivot"] * 3),
        ({"gap": 0.5}, ["a rod is off its length by 0.5 of it"] * 3),
        ({"risen": 0.05}, ["", "", "the energy rises by 0.05 of its scale"]),
    ],
)
def test_what_was_not_won_has_its_reason(changes, reasons):
    assert [title.judge(replace(GOOD, **changes)).reason for title in TITLES] == reasons
