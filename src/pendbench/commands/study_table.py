"""What a study found, for Python: its table of cases, its answer and its folder."""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pandas as pd

from pendbench.report.page import Report
from pendbench.report.tables import data_frame


class StudyTable(pd.DataFrame):
    """A pandas DataFrame with a row for each case, and with what the study found.

    cases: the table alone. answer: the study's answer, at most three sentences. folder: where its report is. In a
    notebook it shows the answer and, of each case, the columns that are worth a glance.
    """

    title: str
    answer: str
    folder: Path
    glance: list[str]
    _metadata = ["title", "answer", "folder", "glance"]  # pandas takes other attributes for columns

    @classmethod
    def of(cls, report: Report, folder: Path) -> StudyTable:
        """The table of a report that is in a folder."""
        table = cls(data_frame(report.cases))
        table.title, table.answer, table.folder = report.results.title, report.answer, folder
        table.glance = list(report.summary)
        return table

    @property
    def _constructor(self) -> Any:
        return pd.DataFrame  # some of its rows are not what the study found

    @property
    def cases(self) -> pd.DataFrame:
        """The table, a row for each case."""
        return pd.DataFrame(self)

    def _repr_html_(self) -> str:
        path = self.folder / "report.html"
        report = f'<a href="{html.escape(quote(str(path)))}">{html.escape(str(path))}</a>'
        rows = self.cases[self.glance].to_html(index=False, max_rows=60, na_rep="")
        return f"<h3>{html.escape(self.title)}</h3><p>{html.escape(self.answer)}</p><p>Report: {report}</p>{rows}"
