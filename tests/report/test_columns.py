"""Columns and tables: what is declared is what is written, and numbers survive being written."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendbench.report.columns import CASE, Column, Floored, Table, text_column
from pendbench.report.numbers import NOTHING, duration_text, number_text, times_text
from pendbench.report.tables import csv_text, data_frame, markdown_table
from pendbench.scene.scene import load_scene
from pendbench.study.case import Case


@dataclass(frozen=True)
class Row:
    error_max: object = 1.0
    reason: object = ""
    steps: object = None
    status: str = "ok"


ERROR = Column("error_max", "L", ".1e", "e max", "the largest error")
STEPS = Column("steps", "1", "d", "steps", "steps taken", empty="none")
REASON = text_column("reason", "reason", "why")


def table(*rows: Row) -> Table:
    return Table("rows", (ERROR, STEPS, REASON), rows)


@pytest.mark.parametrize(
    ("value", "floor", "text"), [(1e-3, 1e-9, "1.0e-3"), (1e-12, 1e-9, "< 1.0e-9"), (1e-12, math.nan, "1.0e-12")]
)
def test_what_is_below_its_floor_is_shown_as_that_and_written_as_it_is(value, floor, text):
    column = Floored("error_max", "L", ".1e", "e max", "the largest error", floor=lambda _: floor)
    assert column.text(Row(value)) == text
    assert column.stored(Row(value)) == repr(value)


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


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(3.8e-5, "38 µs"), (9.96e-4, "1 ms"), (2.34e-3, "2.3 ms"), (0.99, "990 ms"), (12.3, "12 s"), (math.inf, NOTHING)],
)
def test_durations_are_in_the_unit_of_their_size(seconds, text):
    assert duration_text(seconds) == text


def test_ratios_have_two_digits_and_a_sign():
    assert times_text(110.4) == "110\u00d7"


def test_what_is_missing_says_so_in_the_words_of_its_column():
    assert ERROR.text(Row(math.nan)) == ERROR.text(Row(None)) == NOTHING
    assert STEPS.text(Row()) == "none"
    assert REASON.text(Row()) == ""


def test_a_value_is_where_the_column_says():
    halved = ERROR.at(lambda row: row.error_max / 2)
    assert (ERROR.value(Row(3.0)), halved.value(Row(3.0))) == (3.0, 1.5)
    case = Case(load_scene("double"), "mujoco", "rk4", None)
    row = type("Of", (), {"case": case})()
    assert [column.text(row) for column in CASE] == ["double", "2", "mujoco", "rk4", "its own", ""]


@given(st.floats(allow_nan=False) | st.integers(-(2**53), 2**53))
def test_numbers_come_back_from_a_csv_file_to_the_last_digit(value):
    cells = list(csv.reader(io.StringIO(csv_text(table(Row(value))))))
    assert cells[0] == ["error_max", "steps", "reason"]
    assert float(cells[1][0]) == value


@pytest.mark.parametrize("value", [None, math.nan, np.nan, ""])
def test_a_missing_value_is_an_empty_cell(value):
    assert ERROR.stored(Row(value)) == ""


def test_whole_numbers_stay_whole_where_some_are_missing():
    assert csv_text(table(Row(1.0, steps=4), Row(1.0))).split() == ["error_max,steps,reason", "1.0,4,", "1.0,,"]


def test_yes_and_no_are_words():
    assert csv_text(table(Row(True))).split()[1] == "true,,"
    assert ERROR.text(Row(False)) == "no"


def test_text_that_a_spreadsheet_would_run_is_text():
    assert csv_text(table(Row(-1.0, "=1+1"))).splitlines()[1] == "-1.0,,'=1+1"


def test_a_frame_has_the_columns_and_the_numbers_of_the_table():
    found = data_frame(table(Row(1.5, "r"), Row(None, "")))
    assert list(found) == ["error_max", "steps", "reason"]
    assert found["error_max"].tolist()[0] == 1.5
    assert math.isnan(found["error_max"][1])
    assert found["reason"].tolist() == ["r", ""]
    assert list(data_frame(table())) == list(found)


def test_a_markdown_table_has_the_columns_asked_for_and_aligns_numbers():
    text = markdown_table(table(Row(1e-9, "a|b")), ("reason", "error_max"))
    assert text.splitlines() == ["| reason | e max |", "| --- | ---: |", "| a\\|b | 1.0e-9 |"]


def test_a_column_that_is_not_there_is_named():
    with pytest.raises(KeyError, match="rows has no column nothing"):
        markdown_table(table(Row()), ("nothing",))
