"""Columns: what a study writes is declared, and numbers survive being written."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import report_data
from pendbench.report.columns import COLUMNS, NOTHING, Column, in_order, number_text, shown, stored
from pendbench.report.tables import csv_text
from pendbench.study.chaos import run
from pendbench.study.jobs import Outcome
from pendbench.study.plan import load_plan
from pendbench.study.runner import Runner
from pendbench.study.store import Store

STUDY = """
title  = "Two steps of a pendulum"
scenes = ["short.toml"]
starts = 1
sample = 0.05
order_time    = 0.1
lyapunov_time = 0.5

[[engines]]
name    = "analytic"
methods = ["adaptive"]

[[engines]]
name    = "analytic"
methods = ["rk4"]
dt      = [5e-2, 25e-3]
"""
SCENE = """
duration = 0.2

[chain]
masses  = [1.0, 1.0]
lengths = [1.0, 1.0]

[start]
angles = 1.0

[effects]
gravity = 9.81
"""


class Here:
    """Runs jobs in this process."""

    def run(self, jobs, *, alone=False):  # noqa: ARG002
        for job in jobs:
            yield Outcome(job, job.function(*job.arguments))


def small_study(folder: Path):
    (folder / "short.toml").write_text(SCENE)
    (folder / "study.toml").write_text(STUDY)
    return run(load_plan(folder / "study.toml"), Runner(Store(folder / "work"), Here()))


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    return small_study(tmp_path_factory.mktemp("real"))


def test_every_column_of_a_study_is_declared(real):
    frames = {"cases": real.cases, **real.tables}
    undeclared = {table: set(frame.columns) - set(COLUMNS) for table, frame in frames.items()}
    assert not any(undeclared.values()), f"declare these in report/columns.py: {undeclared}"


def test_the_made_up_results_of_the_report_s_tests_have_the_columns_of_a_study(real):
    made_up = report_data.results()
    assert set(made_up.cases) == set(real.cases)
    assert {name: set(frame) for name, frame in made_up.tables.items()} == {
        name: set(frame) for name, frame in real.tables.items()
    }


def test_what_is_not_declared_a_time_can_be_reproduced(real, tmp_path):
    again = small_study(tmp_path)
    for name in real.cases:
        if not COLUMNS[name].is_time:
            pd.testing.assert_series_equal(real.cases[name], again.cases[name], rtol=0, atol=0)
    for name, table in real.tables.items():
        assert csv_text(table) == csv_text(again.tables[name])


def test_declarations_are_complete():
    for name, column in COLUMNS.items():
        assert column.heading, name
        assert column.meaning, name
        assert column.unit or not column.format, f"{name}: a number has a unit, and 1 is one"


@pytest.mark.parametrize(("suffix", "unit"), [("_s", "s"), ("_rad", "rad"), ("_us", "us"), ("_s_per_s", "s/s")])
def test_units_in_names_are_the_declared_units(suffix, unit):
    named = [name for name in COLUMNS if name.endswith(suffix) and not name.endswith(f"_per{suffix}")]
    named += [name for name in COLUMNS if name.endswith(suffix) and suffix == "_s_per_s"]
    assert named
    assert {COLUMNS[name].unit for name in named} == {unit}


@pytest.mark.parametrize(
    ("value", "spec", "text"),
    [
        (0.012345, ".3g", "0.0123"),
        (12345.6, ".3g", "12300"),
        (1.234e-7, ".1e", "1.2e-7"),
        (-1.234e12, ".1e", "-1.2e12"),
        (0.6049, ".1e", "0.6"),
        (1.5e100, ".3g", "1.5e100"),
        (0.0, ".1e", "0"),
        (-0.0, "d", "0"),
        (-3.0, "d", "-3"),
        (0.256, ".0%", "26%"),
        (math.inf, ".3g", "infinite"),
        (-math.inf, ".3g", "-infinite"),
        (math.nan, ".3g", NOTHING),
        (True, ".3g", "yes"),
        (np.float64(2.0), "d", "2"),
    ],
)
def test_numbers_for_people(value, spec, text):
    assert number_text(value, spec) == text


def test_what_is_missing_says_so_in_the_words_of_its_column():
    assert shown("dt", math.nan) == "its own"
    assert shown("error_max", None) == NOTHING
    assert shown("reason", "") == ""
    assert shown("nobody declared this", 1.23456) == "1.235"


@given(st.floats(allow_nan=False) | st.integers(-(2**53), 2**53))
def test_numbers_come_back_from_a_csv_file_to_the_last_digit(value):
    cells = list(csv.reader(io.StringIO(csv_text(pd.DataFrame({"error_max": [value]})))))
    assert float(cells[1][0]) == value


@pytest.mark.parametrize("value", [None, math.nan, np.nan, pd.NA, ""])
def test_a_missing_value_is_an_empty_cell(value):
    assert stored("error_max", value) == ""


def test_whole_numbers_stay_whole_where_some_are_missing():
    assert csv_text(pd.DataFrame({"order_claimed": [4, math.nan, 1]})).split() == ["order_claimed", "4", '""', "1"]


def test_columns_are_written_as_declared_and_unknown_ones_last():
    assert in_order(["zzz", "flags", "dt", "scene", "aaa"]) == ["scene", "dt", "flags", "zzz", "aaa"]


def test_a_column_cannot_be_changed():
    with pytest.raises(TypeError):
        COLUMNS["scene"] = Column("", "", "", "")
