"""The report: complete, safe, the same every time, and there whatever the engines did."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
from dataclasses import dataclass, replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from pendbench.base.errors import printable
from pendbench.base.files import write_whole
from pendbench.report import page as page_module
from pendbench.report.columns import Column, Table, text_column
from pendbench.report.page import Report
from pendbench.report.tables import csv_text
from pendbench.report.terminal import summary_table
from pendbench.report.text import file_name, grid, label, markdown, spreadsheet
from pendbench.report.write import write_report
from support import report_data
from support.reading import PNG, cells_of, render, section
from support.report_data import ENGINE, HOSTILE, report, results

ANY_TEXT = st.text(st.characters(codec=None), max_size=60)  # lone surrogates too
NASTY = ["=1+1", "+1", "-1", "@x", "\t=1", " =1", "\uff1d1", "-", "a|b", "`|`", "<b>|</b>", "\\|", "a\nb", "\r\n"]


@dataclass(frozen=True)
class Told:
    reason: str


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    write_report(report(), out)
    return out


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.md").read_text("utf-8")


# Text that comes from elsewhere


@given(ANY_TEXT)
@example(HOSTILE)
def test_markdown_shows_any_text_and_does_nothing_with_it(text):
    rows = cells_of(grid(["a", "b"], [[f"x{markdown(text)}x", "last"]]))
    # Markdown joins neighbouring spaces no more than it has to: the text is what it was, on one line.
    assert rows[1] == [f"x{printable(text)}x", "last"]


@pytest.mark.parametrize("text", NASTY)
def test_markdown_of_nasty_text(text):
    assert cells_of(grid(["a", "b"], [[f"x{markdown(text)}x", "last"]]))[1] == [f"x{printable(text)}x", "last"]


@given(ANY_TEXT)
@example(HOSTILE)
def test_no_cell_of_a_csv_file_is_a_formula(text):
    table = Table("rows", (text_column("reason", "reason", "why"),), [Told(text), Told("after")])
    rows = list(csv.reader(io.StringIO(csv_text(table))))
    assert len(rows) == 3
    cell = rows[1][0]
    assert not cell.lstrip().startswith(("=", "+", "-", "@", "\t", "\r", "\uff1d", "\uff0b", "\uff0d", "\uff20"))
    assert cell.removeprefix("'") == printable(text).removeprefix("'")


@pytest.mark.parametrize("text", NASTY[:8])
def test_formulas_get_an_apostrophe(text):
    assert spreadsheet(text) == f"'{printable(text)}"


@given(st.lists(ANY_TEXT, max_size=5))
def test_file_names_are_safe_and_differ(texts):
    names: list[str] = []
    for text in texts:
        names.append(file_name(text, names))
    assert all(re.fullmatch(r"[0-9A-Za-z_-]+", name) for name in names)
    assert len({name.lower() for name in names}) == len(names)


def test_long_text_is_clipped_and_labels_are_never_hidden():
    assert len(markdown("x" * 10_000)) == 240
    assert not label("_hidden").startswith("_")
    assert label("$x$") == r"\$x\$"


# What is written


def test_everything_is_written(written):
    found = {path.relative_to(written).as_posix() for path in written.rglob("*") if path.is_file()}
    plots = {f"plots/{kind}_{scene}.png" for kind in ("error", "energy") for scene in ("calm", "wild", "_a_b_1_1")}
    tables = {f"{name}.csv" for name in ("cases", "scenes", "causes", "starts", "curves")}
    assert found == {
        "report.md",
        "report.html",
        "provenance.json",
        "plots/cost.png",
        "plots/cost_regular.png",
        *plots,
        *tables,
    }
    assert all((written / plot).read_bytes().startswith(PNG) for plot in plots)


def test_every_case_is_a_row(written):
    rows = list(csv.DictReader(io.StringIO((written / "cases.csv").read_text("utf-8"))))
    assert len(rows) == 27
    by_status = [row["status"] for row in rows]
    assert {"refused", "timed out", "crashed", "torn", "not finite"} < set(by_status)
    refused = rows[by_status.index("refused")]
    assert refused["error_max"] == refused["step_us"] == ""


def test_the_same_results_give_the_same_bytes(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    write_report(report(scenes=("wild",)), first)
    write_report(report(scenes=("wild",)), second)
    files = [path.relative_to(first) for path in first.rglob("*") if path.is_file()]
    assert len(files) == 11
    for path in files:
        assert (first / path).read_bytes() == (second / path).read_bytes(), path


def test_provenance_is_json_that_any_program_reads(written):
    found = json.loads((written / "provenance.json").read_text(), parse_constant=pytest.fail)
    assert found["nested"] == {"a": [1, 2], "b": None}
    assert found["seed"] == 7


def test_a_file_that_cannot_be_finished_leaves_the_old_one(tmp_path):
    path = tmp_path / "a.csv"
    write_whole(path, lambda file: file.write(b"old"))

    def fail(file):
        file.write(b"new")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_whole(path, fail)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_no_plots_are_loaded_with_the_report():
    code = "import sys, pendbench.report.page, pendbench.kinds.chaos.page; assert 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


# What the page says


def test_every_plot_is_shown_and_every_link_leads_to_a_file(written, page):
    links = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", page)
    assert sorted(links) == sorted(f"plots/{path.name}" for path in (written / "plots").iterdir())


def test_tables_are_tables_whatever_is_in_them(page):
    """Each row has as many cells as its table's heading: counted in the text, since parsers mend what does not fit."""
    width = 0
    for line in page.splitlines():
        cells = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        assert cells in (0, width) or width == 0, line
        width = cells


def test_nothing_on_the_page_is_html_or_a_link(page):
    tokens = MarkdownIt("commonmark").enable("table").parse(page)
    kinds = {token.type for token in tokens} | {child.type for token in tokens for child in token.children or ()}
    assert not kinds & {"html_block", "html_inline", "link_open", "fence", "code_block"}


def test_the_title_is_that_of_the_study(page):
    assert page.startswith("# Which one?")
    assert "quick variant" not in page


def test_every_failure_is_told_with_its_reason(page):
    failed = section(page, "What was refused, and what failed")
    assert "5 cases of 27 did not end well" in failed
    for status, reason in report_data.FAILURES.values():
        assert status in failed
        assert markdown(reason) in failed


def test_definitions_cover_every_column_of_every_table(page):
    defined = set(re.findall(r"`([^`]+)`", section(page, "Appendix: what the columns mean")))
    assert {column.name for table in report().tables.values() for column in table.columns} <= defined


def test_quick_says_that_it_is():
    quick = report(scenes=("calm",), quick=True)
    assert "quick variant" in quick.markdown()


PARTIAL = {
    "one engine": {"scenes": ("calm",), "engines": ("ours",)},
    "all failed": {"failing": True},
    "no cases": {"engines": ()},
    "no scenes": {"scenes": ()},
    "only a refusal": {"scenes": ("calm",), "engines": (ENGINE,)},
}


@pytest.mark.parametrize("changes", PARTIAL.values(), ids=PARTIAL)
def test_partial_results_are_reported(changes, tmp_path):
    made = report(**changes)
    write_report(made, tmp_path)
    page = (tmp_path / "report.md").read_text("utf-8")
    assert "## Appendix: where the numbers come from" in page
    for plot in re.findall(r"\((plots/[^)]*)\)", page):
        assert (tmp_path / plot).is_file()
    assert render(summary_table(made))
    assert made.answer
    assert not re.search(r"\bnan\b", made.answer + page)


def test_a_kind_without_a_page_gets_the_plain_one(monkeypatch):
    found = page_module.part_of_kind
    monkeypatch.setattr(page_module, "part_of_kind", lambda kind, part: None if part == "page" else found(kind, part))
    made = Report(results())
    assert len(cells_of(section(made.markdown(), "The cases"))) == len(made.cases) + 1
    assert made.answer == "22 cases of 27 ended well."


# The terminal


def test_the_terminal_shows_every_case_and_obeys_none():
    made = report(scenes=("wild",))
    name = Column("engine", "", "", "engine", "hostile", lambda _: "[red]\x1b[31mx")
    flags = text_column("flags", "flags", "flags", lambda _: "noisy timing: spread 50%; plateau: at 1e-3")
    swapped = {"engine": name, "flags": flags}
    cases = made.cases
    made.tables["cases"] = replace(cases, columns=tuple(swapped.get(each.name, each) for each in cases.columns))
    text = render(summary_table(made))
    assert text.count("[red]") == len(cases)
    assert "\x1b" not in text
    assert "noisy timing, plateau" in text
    assert "> 8" in text
