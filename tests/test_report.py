"""The report: complete, safe, the same every time, and there whatever the engines did."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
from dataclasses import replace

import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from rich.console import Console

import report_data
from pendbench.files import write_whole
from pendbench.report import answer, summary_table, write_report
from pendbench.report.chaos_causes import engine_sentences, growth_sentences, twins
from pendbench.report.chaos_prices import prices
from pendbench.report.rows import records
from pendbench.report.tables import csv_text
from pendbench.report.text import file_name, label, markdown, spreadsheet, table
from pendbench.strict import printable
from report_data import ENGINE, HOSTILE, NAN, results

ANY_TEXT = st.text(st.characters(codec=None), max_size=60)  # lone surrogates too
NASTY = ["=1+1", "+1", "-1", "@x", "\t=1", " =1", "\uff1d1", "-", "a|b", "`|`", "<b>|</b>", "\\|", "a\nb", "\r\n"]
PNG = b"\x89PNG\r\n\x1a\n"


def cells_of(markdown_text: str) -> list[list[str]]:
    """The plain text of every cell of every table, by row, as a Markdown parser sees it."""
    rows: list[list[str]] = []
    for token in MarkdownIt("commonmark").enable("table").parse(markdown_text):
        if token.type == "tr_open":
            rows.append([])
        if token.type == "inline" and token.level >= 4:
            assert all(child.type in ("text", "strong_open", "strong_close", "text_special", "code_inline", "image")
                       for child in token.children), token.children  # fmt: skip
            rows[-1].append("".join(child.content for child in token.children))
    return rows


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    write_report(results(), out)
    return out


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.md").read_text("utf-8")


def section(page: str, heading: str) -> str:
    """What stands under one heading."""
    return re.split(r"^## ", page.split(f"## {heading}\n", 1)[1], maxsplit=1, flags=re.MULTILINE)[0]


def render(table_or_text) -> str:
    console = Console(width=200, file=io.StringIO(), color_system=None)
    console.print(table_or_text)
    return console.file.getvalue()


# Text that comes from elsewhere


@given(ANY_TEXT)
@example(HOSTILE)
def test_markdown_shows_any_text_and_does_nothing_with_it(text):
    rows = cells_of(table(["a", "b"], [[f"x{markdown(text)}x", "last"]]))
    # Markdown joins neighbouring spaces no more than it has to: the text is what it was, on one line.
    assert rows[1] == [f"x{printable(text)}x", "last"]


@pytest.mark.parametrize("text", NASTY)
def test_markdown_of_nasty_text(text):
    assert cells_of(table(["a", "b"], [[f"x{markdown(text)}x", "last"]]))[1] == [f"x{printable(text)}x", "last"]


@given(ANY_TEXT)
@example(HOSTILE)
def test_no_cell_of_a_csv_file_is_a_formula(text):
    rows = list(csv.reader(io.StringIO(csv_text(pd.DataFrame({"reason": [text, "after"]})))))
    assert len(rows) == 3
    cell = rows[1][0]
    assert not cell.lstrip().startswith(("=", "+", "-", "@", "\t", "\r", "\uff1d", "\uff0b", "\uff0d", "\uff20"))
    assert cell.removeprefix("'") == printable(text).removeprefix("'")


@pytest.mark.parametrize("text", NASTY[:8])
def test_formulas_get_an_apostrophe(text):
    assert spreadsheet(text) == f"'{printable(text)}"


def test_negative_numbers_are_no_formulas():
    assert csv_text(pd.DataFrame({"growth_per_s": [-0.5], "n": [-1]})) == "n,growth_per_s\n-1,-0.5\n"


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
    assert found == {"report.md", "provenance.json", "plots/cost.png", *plots, *tables}
    assert all((written / plot).read_bytes().startswith(PNG) for plot in plots)


def test_every_case_is_a_row(written):
    rows = list(csv.DictReader(io.StringIO((written / "cases.csv").read_text("utf-8"))))
    assert len(rows) == len(results().cases)
    by_status = [row["status"] for row in rows]
    assert {"refused", "timed out", "crashed", "torn", "not finite"} < set(by_status)
    refused = rows[by_status.index("refused")]
    assert refused["error_max"] == refused["step_us"] == ""


def test_the_same_results_give_the_same_bytes(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    write_report(results(scenes=("wild",)), first)
    write_report(results(scenes=("wild",)), second)
    files = [path.relative_to(first) for path in first.rglob("*") if path.is_file()]
    assert len(files) == 10
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
    code = "import sys, pendbench.report.chaos; assert 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


# What the page says


def test_the_page_has_its_parts_in_order(page):
    headings = re.findall(r"^## (.*)$", page, flags=re.MULTILINE)
    assert [heading for heading in headings if not heading.startswith("Scene ")] == [
        "What was asked",
        "The answer",
        "The scenes",
        "Why they leave the truth",
        "What time on the true path costs",
        "What failed",
        "How it was measured",
        "How far to trust the timings",
        "Where the numbers come from",
    ]
    assert page.startswith("# Which one?")
    assert "quick variant" not in page


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


def test_failures_are_in_every_table(page):
    failed = section(page, "What failed")
    assert "5 cases of 27 did not end well" in failed
    for (_, _, _, _), (status, reason) in report_data.FAILURES.items():
        assert status in failed
        assert markdown(reason) in failed
    wild = section(page, "Scene wild")
    assert all(f"**{status}**" in wild for status in ("not finite", "timed out", "torn", "crashed"))
    assert "**refused**" in section(page, "Scene calm")


def test_what_is_missing_is_said_in_words(page):
    calm, wild = section(page, "Scene calm"), section(page, "Scene wild")
    assert "not before the horizon" in calm
    assert "regular motion" in calm
    assert "not before the horizon" in wild
    assert "regular motion" not in wild
    assert "> 16" in str(cells_of(wild))  # the horizon of 8 s is 16 Lyapunov times of 0.5 s


def test_times_show_the_median_and_the_extremes(page):
    row = next(row for row in cells_of(section(page, "Scene wild")) if row[:3] == ["ours", "rk4", "0.01"])
    assert row[4] == "4.61 [4.14 .. 5.07]"  # ln(1e-2 / 1e-6) / 2 per s, a tenth less and a tenth more
    assert row[6] == "6.91 / 9.21 / 11.5"


def test_a_time_that_only_some_starts_have_says_so(tmp_path):
    found = results(scenes=("wild",), engines=("ours",), without=("curves",))
    some = {f"t_{name}_not_reached": 1 for name in ("1e-3", "1e-2")}
    cases = found.cases.assign(**some, **{"t_1e-3_max_s": NAN, "t_1e-2_max_s": NAN})
    cases.loc[1, "t_1e-2_s"], cases.loc[1, "t_1e-2_min_s"] = NAN, 7.0
    write_report(replace(found, cases=cases), tmp_path)
    rows = cells_of(section((tmp_path / "report.md").read_text("utf-8"), "Scene wild"))
    assert rows[2][3] == "3.45 [3.11 .. not before the horizon]"
    assert rows[2][4] == "not before the horizon [7 ..]"
    row = next(row for row in rows if row[2] == "0.001")
    assert row[4] == "not before the horizon"


def test_noise_is_named(page):
    timings = section(page, "How far to trust the timings")
    assert "- calm: other rk4, step 0.001 s: spread 50%" in timings
    assert timings.count("spread 50%") == 3
    assert "24 cases of 27 were timed" in timings


def test_engines_are_compared_at_equal_accuracy(page):
    rows = {tuple(row[:2]): row[2:] for row in cells_of(section(page, "What time on the true path costs"))}
    # Half of the horizon is 4 s: rk4 with 0.01 s stays for 4.6 s and costs a tenth of what the finer step does.
    assert rows["wild", "ours"] == ["4", "ours rk4, step 0.01 s", "1", "steady"]
    assert rows["wild", ENGINE][1] == "none of its cases"  # torn after 1.15 s, and crashed
    assert rows["calm", "other"][1] == "other rk4, step 0.01 s"


def test_a_noisy_price_says_so():
    found = results(scenes=("wild",), engines=("other",))
    cases = records(found.cases.assign(flags="noisy timing: spread 50%", step_spread=0.5))
    assert cells_of(prices(cases))[1][-1] == "noisy (50%)"


def test_definitions_cover_every_column_of_every_table(page):
    defined = set(re.findall(r"`([^`]+)`", section(page, "How it was measured")))
    found = results()
    names = {name for frame in (found.cases, *found.tables.values()) for name in frame}
    assert names <= defined


def test_quick_says_that_it_is(tmp_path):
    write_report(results(scenes=("calm",), quick=True, without=("curves",)), tmp_path)
    assert "quick variant" in (tmp_path / "report.md").read_text("utf-8")


PARTIAL = {
    "one engine": {"scenes": ("calm",), "engines": ("ours",)},
    "all failed": {"failing": True},
    "no curves": {"without": ("curves",)},
    "no truth": {"scenes": ("wild",), "without": ("scenes",)},
    "no starts": {"scenes": ("wild",), "without": ("starts",)},
    "nothing but cases": {"without": ("scenes", "causes", "starts", "curves")},
    "no cases": {"engines": ()},
    "only a refusal": {"scenes": ("calm",), "engines": (ENGINE,)},
}


@pytest.mark.parametrize("changes", PARTIAL.values(), ids=PARTIAL)
def test_partial_results_are_reported(changes, tmp_path):
    found = results(**changes)
    write_report(found, tmp_path)
    page = (tmp_path / "report.md").read_text("utf-8")
    assert "## Where the numbers come from" in page
    for plot in re.findall(r"\((plots/[^)]*)\)", page):
        assert (tmp_path / plot).is_file()
    assert render(summary_table(found))
    assert "nan" not in answer(found)
    assert not re.search(r"\bnan\b", page)


def test_empty_tables_are_reported(tmp_path):
    empty = results(scenes=())
    write_report(empty, tmp_path)
    assert "every case ran to its end" in (tmp_path / "report.md").read_text("utf-8").lower()


def test_a_scene_without_a_truth_says_so(tmp_path):
    found = results(scenes=("wild",), failing=True, without=("curves",))
    lost = found.tables["scenes"].assign(
        horizon_s=NAN, horizon_min_s=NAN, horizon_max_s=NAN, reference_error=NAN, status="timed out", reason="too slow"
    )
    write_report(replace(found, tables={**found.tables, "scenes": lost}), tmp_path)
    page = (tmp_path / "report.md").read_text("utf-8")
    assert "There is no truth to compare with: **timed out**: too slow." in page
    assert "the truth of wild: **timed out**: too slow" in section(page, "What failed")


def test_a_kind_without_a_page_gets_the_plain_one(tmp_path):
    found = replace(results(), kind="something else")
    write_report(found, tmp_path)
    page = (tmp_path / "report.md").read_text("utf-8")
    assert len(cells_of(section(page, "The cases"))) == len(found.cases) + 1
    assert answer(found) == "22 cases of 27 ended well."


# The answer


def test_the_answer_names_the_best_the_best_of_the_others_and_what_they_cost():
    found = results(scenes=("calm", "wild"))
    text = answer(found)
    first, second = text.split(". ", 1)
    assert "In the chaotic scene wild" in first  # the regular one does not count
    assert "ours adaptive" in first
    assert "before the horizon (8 s)" in first
    assert "10 ms of computing per simulated second" in first
    assert second.startswith("The best of the other engines is")
    assert ENGINE.split("|", maxsplit=1)[0] in second


def test_the_answer_is_made_from_the_numbers():
    found = results(scenes=("wild",), engines=("ours", "other"))
    cases = found.cases.copy()
    ours = cases["engine"] == "ours"
    cases.loc[ours, "t_1e-2_s"] = 2.0  # a quarter of the horizon
    cases.loc[~ours, "t_1e-2_s"] = 4.0
    cases.loc[~ours, "simulated_s_per_s"] = 50.0
    starts = found.tables["starts"].drop(found.tables["starts"].index)
    text = answer(replace(found, cases=cases, tables={**found.tables, "starts": starts}))
    first, second = text.split(". ", 1)
    assert re.search(r"other .* longest.*after 4 s \(50% of the horizon\), for 20 ms", first)
    assert re.search(r"ours .* after 2 s \(25% of the horizon\)", second)


def test_shares_of_the_horizon_are_those_of_each_start():
    """A start with a late horizon can leave the truth later than another one's horizon; that is no share above 1."""
    found = results(scenes=("wild",), engines=("ours",))
    starts = found.tables["starts"].assign(**{"horizon_s": 20.0, "t_1e-2_s": 10.0})
    cases = found.cases.assign(**{"t_1e-2_s": 10.0})
    assert "after 10 s (50% of the horizon)" in answer(
        replace(found, cases=cases, tables={**found.tables, "starts": starts})
    )


def test_engines_that_stay_as_long_share_the_first_place():
    text = answer(results(scenes=("wild",), engines=("ours", "other")))
    assert "as long)" in text.split(". ", 1)[0]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"failing": True}, "None of the 27 cases of this study stayed"),
        ({"engines": ("ours",)}, "No other engine took part."),
        ({"scenes": ("calm",)}, "In the regular scene calm"),
        ({"scenes": ("wild",), "engines": ("ours", ENGINE)}, "ours"),
    ],
)
def test_answers_to_partial_results(changes, says):
    assert says in answer(results(**changes))


# Why they leave


def test_causes_say_which_system_is_simulated():
    found = results()
    told = list(engine_sentences(records(found.tables["causes"]), records(found.cases)))
    ours = next(text for text in told if text.startswith("ours"))
    assert "simulates the same system: its accelerations agree with the equations to 1.0e-12" in ours
    assert "rk4 3.99 (4 claimed)" in ours
    other = next(text for text in told if text.startswith(ENGINE))
    assert "simulates another system" in other
    assert "differ by 2.0e-3" in other


def test_programs_with_the_same_errors_are_told_apart_from_others():
    cases = records(results(scenes=("calm", "wild")).cases)
    cases = [{**row, "error_half": row["error_half"] * 1e6} for row in cases]
    assert twins(cases) == [["other rk4", "ours rk4"]]
    one_off = [{**row, "error_half": row["error_half"] * (1.01 if row["engine"] == "ours" else 1)} for row in cases]
    assert twins(one_off) == []


def test_growth_is_compared_with_what_chaos_does():
    found = results(scenes=("calm", "wild"))
    calm, wild = growth_sentences(records(found.tables["scenes"]), records(found.cases))
    assert "regular" in calm
    assert "a neighbouring start leaves the truth at 2 per s" in wild
    assert re.search(r"(\d+) of \1 are within a factor of 1.5", wild)
    faster = [{**row, "growth_per_s": row["growth_per_s"] * 3} for row in records(found.cases)]
    _, wild = growth_sentences(records(found.tables["scenes"]), faster)
    assert re.search(r"0 of \d+ are within", wild)


# The terminal


def test_the_terminal_shows_every_case_and_obeys_none():
    found = results(scenes=("wild",))
    hostile = found.cases.assign(engine="[red]\x1b[31mx", flags="noisy timing: spread 50%; plateau: at 1e-3")
    text = render(summary_table(replace(found, cases=hostile)))
    assert text.count("[red]") == len(hostile)
    assert "\x1b" not in text
    assert "noisy timing, plateau" in text
    assert "> 8" in text
