"""What `run_study` gives: a table for programs, with what the study found, which a notebook shows."""

from __future__ import annotations

import pickle
from pathlib import Path

import pandas as pd
import pytest

from pendbench.commands.study_table import StudyTable
from pendbench.report.tables import data_frame
from support import report_data


@pytest.fixture
def table():
    return StudyTable.of(report_data.report(), Path("results/made"))


def test_it_is_the_table_of_cases_with_an_answer_and_a_folder(table):
    report = report_data.report()
    expected = data_frame(report.cases)
    pd.testing.assert_frame_equal(table.cases, expected)
    assert type(table.cases) is pd.DataFrame
    assert isinstance(table, pd.DataFrame)
    assert (table.answer, table.folder) == (report.answer, Path("results/made"))
    assert table["status"].tolist() == expected["status"].tolist()


def test_a_part_of_it_is_a_table_and_not_what_the_study_found(table):
    for part in (table[table["n"] > 1], table.head(1), table.copy()):
        assert type(part) is pd.DataFrame
        assert not hasattr(part, "answer")


def test_it_goes_through_a_file_of_python(table):
    assert pickle.loads(pickle.dumps(table)).answer == table.answer


def test_a_notebook_shows_the_answer_and_what_is_worth_a_glance(table):
    table.answer, table.title = "5 < 6", "<b>"
    shown = table._repr_html_()
    assert "<h3>&lt;b&gt;</h3><p>5 &lt; 6</p>" in shown
    assert '<a href="results/made/report.html">results/made/report.html</a>' in shown
    assert shown.count("<th>") == len(report_data.report().summary)
