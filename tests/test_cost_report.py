"""The page of a cost study: what it says follows from the numbers, and it is there whatever the engines did."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from markdown_it import MarkdownIt

import cost_data
from cost_data import results
from pendbench.report import answer, summary_table, write_report
from pendbench.report.columns import NOTHING, duration_text
from pendbench.report.cost_long import verdict_of
from pendbench.report.cost_trust import odd, timings
from pendbench.report.rows import records
from pendbench.report.text import markdown
from report_data import ENGINE, HOSTILE, NAN
from test_report import PNG, cells_of, render, section

HEADINGS = [
    "What was asked",
    "The answer",
    "What to use",
    "The scenes",
    "Orders, and the price of a digit",
    "What drifts in long runs",
    "The pendulum of 2000 s (scene a01)",
    "For callers who need every state",
    "What failed",
    "What is odd",
    "How it was measured",
    "How far to trust the timings",
    "Where the numbers come from",
]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    write_report(results(), out)
    return out


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.md").read_text("utf-8")


def rows_of(text: str) -> list[list[str]]:
    """The cells of the tables in a piece of the page."""
    return cells_of(text)


# The page.


def test_the_page_has_its_parts_in_order(page):
    headings = re.findall(r"^## (.*)$", page, flags=re.MULTILINE)
    assert [heading for heading in headings if not heading.startswith("Scene ")] == HEADINGS
    assert page.startswith("# What does it cost?")


def test_everything_is_written_and_every_plot_is_shown(written, page):
    found = {path.relative_to(written).as_posix() for path in written.rglob("*") if path.is_file()}
    plots = {f"plots/{kind}_{scene}.png" for kind in ("work", "steps") for scene in ("calm", "a01", "_a_b_1_1")}
    plots.add("plots/long_calm.png")
    tables = {f"{name}.csv" for name in ("cases", "scenes", "orders", "prices", "long_runs", "curves")}
    assert found == {"report.md", "provenance.json", *plots, *tables}
    assert all((written / plot).read_bytes().startswith(PNG) for plot in plots)
    assert sorted(re.findall(r"!\[[^\]]*\]\(([^)]*)\)", page)) == sorted(plots)


def test_the_same_results_give_the_same_bytes(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    for out in (first, second):
        write_report(results(scenes=("calm",)), out)
    for path in (path for path in first.rglob("*") if path.is_file()):
        assert path.read_bytes() == (second / path.relative_to(first)).read_bytes(), path


def assert_tables(page):
    """Each row has as many cells as the one above it."""
    width = 0
    for line in page.splitlines():
        cells = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        assert cells in (0, width) or width == 0, line
        width = cells


def test_tables_are_tables_whatever_is_in_them(page, tmp_path):
    assert_tables(page)
    write_report(results(scenes=("a01",), engines=(ENGINE,)), tmp_path)  # its name is the best there is
    theirs = (tmp_path / "report.md").read_text("utf-8")
    assert_tables(theirs)
    assert rows_of(section(theirs, "What to use"))[1][2] == f"{ENGINE} -1+1`$\\frac$, step 0.001 s"


def test_nothing_on_the_page_is_html_or_a_link(page):
    tokens = MarkdownIt("commonmark").enable("table").parse(page)
    kinds = {token.type for token in tokens} | {child.type for token in tokens for child in token.children or ()}
    assert not kinds & {"html_block", "html_inline", "link_open", "fence", "code_block"}


def test_definitions_cover_every_column_of_every_table(page):
    defined = set(re.findall(r"`([^`]+)`", section(page, "How it was measured")))
    found = results()
    assert {name for frame in (found.cases, *found.tables.values()) for name in frame} <= defined


def test_columns_that_depend_on_the_clock_are_named(page):
    text = section(page, "Where the numbers come from")
    assert all(f"`{name}`" in text for name in ("run_s", "step_and_state_us", "with_states_s", "digit_price"))


# What to use, and what it costs.


def test_what_to_use_is_the_cheapest_and_says_how(page):
    rows = {(row[0], row[1]): row[2:] for row in rows_of(section(page, "What to use"))[1:]}
    assert len(rows) == len(cost_data.SCENES) * len(cost_data.ACCURACIES)
    use, cost, others = rows["calm", "1e-3"]
    assert (use, cost) == ("ours adaptive, tolerance 1.0e-4", "≤ 0.02")  # 20 steps of 2 us for 2 s
    assert others == f"other rk4, step 0.01 s: ≤ 1; {ENGINE} none measured (refused)"
    _, _, others = rows["a01", "1e-3"]
    assert "other rk4, step 0.0178 s: 0.56" in others  # (1e-3 / 1e4)^(1/4) s, and 10 us for each
    assert f"{ENGINE} not reached (best 1.0e-2)" in others


def test_times_come_with_how_and_with_the_ratio_to_the_cheapest(page):
    tables = rows_of(section(page, "Scene calm"))
    engines = {row[0]: row[1:] for row in tables[1:4]}
    assert tables[0] == ["engine", "to 1e-2", "to 1e-3", "to 1e-4", "to 1e-8"]
    assert engines["ours"][0] == "≤ 40 µs: adaptive, tolerance 1.0e-4"
    assert engines["other"][0] == "≤ 1 ms (25\u00d7): euler iterations=10, step 0.01 s"
    assert engines["other"][3] == "not reached (best 1.0e-8)"
    assert engines[ENGINE] == ["none measured (refused)"] * 4
    methods = {tuple(row[:2]): row[2:] for row in tables[5:]}
    assert len(methods) == len(cost_data.METHODS)
    assert methods["ours", "rk4"] == ["≤ 100 µs (2.5\u00d7)", "110 µs (2.8\u00d7)", "200 µs (5\u00d7)",
                                      "not reached (best 1.0e-8)"]  # fmt: skip
    assert methods["other", "euler iterations=10"][1:] == ["10 ms (250\u00d7)", "not reached (best 1.0e-3)", NOTHING]


def test_the_cheapest_is_bold(page):
    bold = re.findall(r"\*\*([^*]+)\*\*", section(page, "Scene a01"))
    assert set(bold) == {"≤ 40 ms", "400 ms"}


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (3.84e-5, "38 µs"),
        (9.94e-4, "990 µs"),
        (9.96e-4, "1 ms"),
        (0.0023, "2.3 ms"),
        (0.9999, "1 s"),
        (1.44, "1.4 s"),
        (123.0, "120 s"),
        (1.2e-9, "0.0012 µs"),
        (NAN, NOTHING),
    ],
)
def test_times_have_the_unit_of_their_size(seconds, text):
    assert duration_text(seconds) == text


def test_orders_show_what_is_claimed_and_what_is_seen(page):
    rows = {tuple(row[:3]): row[3:] for row in rows_of(section(page, "Orders, and the price of a digit"))[1:]}
    assert rows["calm", "ours", "rk4"] == ["4", "3.99 (0.01 to 0.001 s)", "none", "1.8\u00d7", "1.0e-8"]
    assert rows["calm", "ours", "adaptive"][:2] == ["adaptive", NOTHING]
    assert rows["calm", "other", "euler iterations=10"][3] == "10\u00d7"
    assert rows["calm", ENGINE, "-1+1`$\\frac$"] == ["2", NOTHING, "none", NOTHING, NOTHING]


def test_the_long_pendulum_has_its_section_where_it_is_part_of_the_study(page, tmp_path):
    rows = rows_of(section(page, "The pendulum of 2000 s (scene a01)"))
    assert rows[0] == ["engine", "to 1e-3 m", "with", "smallest error", "of"]
    assert rows[1] == ["ours", "≤ 40 ms", "adaptive, tolerance 1.0e-4", "1.0e-8", "ours adaptive tolerance=1e-08"]
    assert rows[3][1:3] == ["not reached (best 1.0e-2)", NOTHING]
    write_report(results(scenes=("calm",)), tmp_path)
    assert "pendulum of" not in (tmp_path / "report.md").read_text("utf-8")


def test_looks_at_every_state_have_their_price(page):
    text = section(page, "For callers who need every state")
    rows = rows_of(text)
    assert ["ours", "rk4", *["1 → 11 µs (11\u00d7)"] * 3] in rows
    assert ["ours", "adaptive", *["12 µs a look"] * 3] in rows
    assert "11 times as much for ours" in text
    last = next(row for row in reversed(rows) if row[0] == "calm")
    assert last[1] == "40 µs → 120 µs: adaptive, tolerance 1.0e-4"
    assert last[2] == "2 ms → 6 ms (50\u00d7): rk4, step 0.01 s"


# What drifts.

STEADY = {
    "status": "ok",
    "steps": 1e6,
    "dt": 2e-3,
    "energy_slope_share": 1e-4,
    "energy_drift_slope_per_s": 1e-12,
    "energy_drift_band": 1e-6,
    "energy_drift_max": 1e-6,
    "energy_band_first_tenth": 9e-7,
    "energy_band_last_tenth": 1e-6,
}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "no drift"),
        ({"energy_band_last_tenth": 1.79e-6}, "no drift"),
        ({"energy_band_last_tenth": 4.5e-6}, "no trend, but a band that grows 5-fold"),
        ({"energy_band_first_tenth": 0.0}, "no trend, but a band that grows infinite-fold"),
        ({"energy_band_first_tenth": 0.3, "energy_band_last_tenth": 0.02, "energy_drift_max": 0.39},
         "leaves its energy by 0.39 early, and stays there"),
        ({"energy_slope_share": 0.99, "energy_drift_slope_per_s": -2e-8},
         "loses 4.0e-5 of the energy scale in 2000 s, steadily"),
        ({"energy_slope_share": 0.2, "energy_drift_slope_per_s": 2e-8, "energy_band_last_tenth": 1e-5},
         "gains 4.0e-5 of the energy scale in 2000 s, and its band grows 11-fold"),
        ({"energy_slope_share": 0.4, "energy_drift_slope_per_s": -1e-4, "energy_band_first_tenth": 0.25,
          "energy_band_last_tenth": 0.01, "energy_drift_max": 0.36},
         "loses energy, 0.36 of its scale, most of it early"),
        (
            {"energy_drift_max": 4e6, "energy_band_last_tenth": 1e5},
            "blows up: its energy goes 4.0e6 times its scale astray, and the run says nothing of it",
        ),
        ({"energy_drift_band": 0.0, "energy_slope_share": NAN}, "no drift: the energy does not change at all"),
        ({"status": "warned", "reason": "unstable", "steps": 2112.0}, "warned after 2112 steps: unstable"),
        ({"status": "timed out", "reason": "", "steps": NAN}, "timed out: no reason given"),
        ({"energy_drift_band": NAN, "energy_slope_share": NAN}, NOTHING),
    ],
)  # fmt: skip
def test_verdicts_on_long_runs(changes, says):
    assert verdict_of({**STEADY, **changes}) == says


def test_long_runs_are_rows_with_a_verdict(page):
    rows = {tuple(row[1:3]): row[3:] for row in rows_of(section(page, "What drifts in long runs"))[1:]}
    assert rows["ours", "rk4"][-1] == "loses 1.0e-6 of the energy scale in 1000 s, steadily"
    assert rows["other", "euler"][-1] == "no drift"
    assert rows[ENGINE, "-1+1`$\\frac$"][-1].startswith("crashed: =cmd")
    failed = section(page, "What failed")
    assert "Of the long runs" in failed
    assert "1 case of 4 did not end well" in failed


# What to distrust.


def test_failures_are_in_every_table(page):
    failed = section(page, "What failed")
    assert "5 cases of 39 did not end well" in failed
    for status, reason in cost_data.FAILURES.values():
        assert status in failed
        assert markdown(reason) in failed


def test_flags_of_all_steps_are_said_once_and_timings_are_not_among_them():
    flags = "order 3.7 where 4 is claimed; too good: no error at all; noisy timing: spread 40%"
    cases = [{**row, "flags": flags} for row in records(results(scenes=("calm",), engines=("ours",)).cases)]
    said = odd(cases)
    assert said.count("ours rk4: order 3.7 where 4 is claimed") == 1
    assert said.count("ours rk4, step 0.01 s: too good: no error at all") == 1
    assert said.count("ours adaptive: order 3.7") == 1
    assert "noisy" not in said
    assert odd([]).startswith("Nothing: ")


def test_the_page_names_what_is_odd_and_what_is_noisy(page):
    assert section(page, "What is odd").strip() == (
        "- calm: other euler iterations=10: plateau: the error stops at 1.0e-03"
    )
    trust = section(page, "How far to trust the timings")
    assert "calm: other euler iterations=10, step 0.001 s: spread 50%" in trust


def test_runs_too_short_to_time_are_named_with_what_to_do(page):
    trust = section(page, "How far to trust the timings")
    assert "calm: ours adaptive tolerance=0.0001: 40 µs" in trust
    assert "in `[windows]`" in trust
    assert "step 0.001 s: 1 ms" not in trust
    (only,) = timings([{"run_s": 1.0, "step_spread": 0.01}])
    assert "less than" not in only


# The answer.


def test_the_answer_says_who_how_how_much_and_what_not():
    first, how, others, not_reached = answer(results(scenes=("calm", "a01"))).split(". ")
    assert first == "The cheapest engine is ours: at every accuracy from 1e-2 to 1e-8, in both scenes"
    assert how == "Cheapest method: ours adaptive at 1e-2 to 1e-8 (in 8 of 8 pairs of scene and accuracy)"
    assert "the best of other takes 50 times as long (in each of 2 scenes; in 1 of them its coarsest run" in others
    assert f"{ENGINE} cannot be: it does not get there" in others
    assert "for other 1e-8 in calm and a01" in not_reached
    assert f"for {ENGINE} 1e-2 in calm and 1e-3 in a01" in not_reached


def test_the_answer_is_made_from_the_numbers():
    found = results(scenes=("calm", "a01"), engines=("ours", "other"))
    prices = found.tables["prices"].copy()
    dear = (prices.engine == "ours") & (prices.scene == "calm")
    prices.loc[dear, "run_s"] *= 100
    text = answer(replace(found, tables={**found.tables, "prices": prices}))
    assert "No engine is the cheapest everywhere: ours is in 5 of 8 pairs" in text
    assert "of scene and accuracy, other at 1e-2 to 1e-4 in calm." in text
    # In a01 50 times as long; in calm 2 ms where ours takes a hundred times its 40 us.
    assert "the best of other takes 5 times as long (geometric mean of 2 scenes, 0.5 to 50;" in text
    turned = replace(found, cases=found.cases[::-1], tables={**found.tables, "prices": prices})
    assert "the best of other takes 5 times as long" in answer(turned)  # one scene each: the rest decides


def test_noise_is_said_in_the_answer():
    found = results(scenes=("calm",))
    noisy = found.cases.assign(flags="noisy timing: spread 40%")
    assert "noisy" not in answer(found)
    assert answer(replace(found, cases=noisy)).endswith("so these factors are rough.")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"failing": True}, "None of the 39 cases of this study reached an accuracy"),
        ({"engines": ()}, "None of the 0 cases"),
        ({"engines": ("ours",)}, "The only engine that took part is ours."),
        ({"engines": ("ours",)}, "every engine reaches every accuracy"),
        ({"scenes": ("calm",)}, "in scene calm"),
        ({"methods": ("euler",)}, "Cheapest method: other euler iterations=10 at 1e-2 to 1e-3"),
        ({"without": ("prices",)}, "None of the 39 cases"),
    ],
)
def test_answers_to_partial_results(changes, says):
    text = answer(results(**changes))
    assert says in text
    assert "nan" not in text


# Partial results.

PARTIAL = {
    "one engine": {"scenes": ("calm",), "engines": ("ours",)},
    "all failed": {"failing": True},
    "only a refusal": {"scenes": ("calm",), "engines": (ENGINE,)},
    "no prices": {"scenes": ("a01",), "without": ("prices",)},
    "no orders": {"scenes": ("calm",), "without": ("orders",)},
    "no curves": {"scenes": ("calm",), "without": ("curves",)},
    "no long runs": {"scenes": ("calm",), "without": ("long_runs", "curves")},
    "nothing but cases": {"without": ("scenes", "orders", "prices", "long_runs", "curves")},
    "no cases": {"engines": ()},
    "no scenes": {"scenes": ()},
    "quick": {"scenes": ("calm",), "quick": True},
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
    assert not re.search(r"\bnan\b", page)
    assert ("quick variant" in page) == bool(changes.get("quick"))


def test_where_all_failed_every_table_says_so(tmp_path):
    write_report(results(scenes=("calm",), failing=True), tmp_path)
    page = (tmp_path / "report.md").read_text("utf-8")
    assert "nothing gets there" in section(page, "What to use")
    assert "none measured (error)" in section(page, "Scene calm")
    assert "13 cases of 13 did not end well" in section(page, "What failed")
    assert "the truth of calm: **timed out**: too slow" in section(page, "What failed")
    assert "Nothing was timed." in section(page, "For callers who need every state")
    assert not (tmp_path / "plots").exists()
    assert HOSTILE.split("\n", maxsplit=1)[0] not in page  # not as it stands
