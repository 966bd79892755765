"""The page of a cost study: what it says follows from the numbers, and it is there whatever the engines did."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest
from markdown_it import MarkdownIt

from pendbench.kinds.cost.columns import LongRow
from pendbench.kinds.cost.long import verdict_of
from pendbench.kinds.cost.page import facts
from pendbench.kinds.cost.work import LongRun
from pendbench.report.numbers import NOTHING
from pendbench.report.page import Report
from pendbench.report.tables import csv_text
from pendbench.report.terminal import summary_table
from pendbench.report.text import markdown
from pendbench.report.write import write_report
from pendbench.study.case import Case
from pendbench.study.truths import KeptTruth
from support import cost_data
from support.cost_data import results, with_runs, with_timings
from support.reading import PNG, cells_of, render, section
from support.report_data import ENGINE, HOSTILE, NAN, SCENE
from support.scenes import chain

HEADINGS = [
    "The answer",
    "The scenes",
    "Orders",
    "What one more digit costs",
    "What drifts in long runs",
    "The pendulum of the benchmark A01",
    "For callers who read every state",
    "What was refused, and what failed",
    "What is odd",
    "Appendix: what each method costs",
    "Appendix: how far to trust the timings",
    "Appendix: how it was measured",
    "Appendix: what is proved of the truth",
    "Appendix: what the columns mean",
    "Appendix: where the numbers come from",
]
TIMES = "\u00d7"


@pytest.fixture(scope="module", autouse=True)
def _made_up():
    with cost_data.made_up_engines():
        yield


@pytest.fixture(scope="module")
def written(tmp_path_factory, _made_up):
    out = tmp_path_factory.mktemp("report")
    write_report(Report(results()), out)
    return out


@pytest.fixture(scope="module")
def page(written):
    return (written / "report.md").read_text("utf-8")


def page_of(found):
    return Report(found).markdown()


def answer(found):
    return Report(found).answer


# The page.


def test_the_page_has_its_parts_in_order(page):
    headings = re.findall(r"^## (.*)$", page, flags=re.MULTILINE)
    assert [heading for heading in headings if not heading.startswith("Scene ")] == HEADINGS
    assert page.startswith("# What does it cost?")


def test_everything_is_written_and_every_plot_is_shown_once(written, page):
    found = {path.relative_to(written).as_posix() for path in written.rglob("*") if path.is_file()}
    plots = {f"plots/{kind}_{scene}.png" for kind in ("work", "steps") for scene in ("calm", "a01", "_a_b_1_1")}
    plots.add("plots/long_calm.png")
    tables = {f"{name}.csv" for name in ("cases", "scenes", "orders", "prices", "long_runs", "curves")}
    assert found == {"report.md", "report.html", "provenance.json", *plots, *tables}
    assert all((written / plot).read_bytes().startswith(PNG) for plot in plots)
    assert sorted(re.findall(r"!\[[^\]]*\]\(([^)]*)\)", page)) == sorted(plots)


def test_the_same_results_give_the_same_bytes(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    for out in (first, second):
        write_report(Report(results(scenes=("calm",))), out)
    for path in (path for path in first.rglob("*") if path.is_file()):
        assert path.read_bytes() == (second / path.relative_to(first)).read_bytes(), path


def assert_tables(text):
    """Each row has as many cells as the one above it."""
    width = 0
    for line in text.splitlines():
        cells = len(re.findall(r"(?<!\\)\|", line)) if line.startswith("|") else 0
        assert cells in (0, width) or width == 0, line
        width = cells


def test_tables_are_tables_whatever_is_in_them(page):
    assert_tables(page)
    theirs = page_of(results(scenes=("a01",), engines=(ENGINE,)))  # its name is the best there is
    assert_tables(theirs)
    assert cells_of(section(theirs, "The answer"))[:2] == [["scene", ENGINE], ["a01", "not reached (best 1.0e-2)"]]


def test_nothing_on_the_page_is_html_or_a_link(page):
    tokens = MarkdownIt("commonmark").enable("table").parse(page)
    kinds = {token.type for token in tokens} | {child.type for token in tokens for child in token.children or ()}
    assert not kinds & {"html_block", "html_inline", "link_open", "fence", "code_block"}


def test_definitions_cover_every_column_of_every_table(page):
    defined = set(re.findall(r"`([^`]+)`", section(page, "Appendix: what the columns mean")))
    assert {column.name for table in Report(results()).tables.values() for column in table.columns} <= defined


def test_columns_that_depend_on_the_clock_are_named(page):
    text = section(page, "Appendix: where the numbers come from")
    assert all(f"`{name}`" in text for name in ("run_s", "step_and_state_us", "with_states_s", "digit_price"))


#: The columns of the CSV files, in their order: others read them.
COLUMNS = {
    "cases": "scene n engine method dt tolerance settings status reason compare_s horizon_s reference_error error_max "
    "angle_error_max_rad energy_drift_max energy_floor gap_max order_claimed order_observed plateau steps step_us "
    "step_and_state_us step_spread simulated_s_per_s build_s first_call_s run_s flags",
    "scenes": "scene n status reason compare_s samples horizon_s reference_error",
    "orders": "scene n engine method settings best_error order_claimed order_observed order_dt_coarse order_dt_fine "
    "plateau digit_price",
    "prices": "scene accuracy engine method dt tolerance settings best_error run_s with_states_s bound",
    "long_runs": "scene n engine method dt status reason energy_drift_max energy_floor energy_drift_band "
    "energy_drift_slope_per_s energy_slope_share energy_band_first_tenth energy_band_last_tenth steps",
    "curves": "scene engine method dt settings t_s error energy_error",
}


def test_the_files_have_the_columns_that_others_read():
    for name, table in Report(results()).tables.items():
        assert csv_text(table).split("\n")[0] == COLUMNS[name].replace(" ", ","), name


# What it costs.


def test_the_best_of_each_engine_comes_first_with_how_and_with_the_ratio_to_the_cheapest(page):
    best = {row[0]: row[1:] for row in cells_of(section(page, "The answer"))[1:]}
    # 1e-4: ours in 20 steps of 2 us; rk4 of the other has 1e4 h^4, so 200 steps of 10 us.
    assert best["calm"][0] == "≤ 40 µs: adaptive, tolerance 1.0e-4"
    assert best["calm"][1] == f"≤ 2 ms (50{TIMES}): rk4, step 0.01 s"
    assert best["calm"][2] == "none measured (refused)"
    assert best["a01"] == [
        "≤ 40 ms: adaptive, tolerance 1.0e-4",
        f"2 s (50{TIMES}): rk4, step 0.01 s",
        "not reached (best 1.0e-2)",
    ]


def test_each_scene_has_each_engine_s_time_to_each_error(page):
    rows = cells_of(section(page, "Scene calm"))
    engines = {row[0]: row[1:] for row in rows[1:]}
    assert rows[0] == ["engine", "to 1e-2", "to 1e-3", "to 1e-4", "to 1e-8"]
    assert engines["ours"][0] == "≤ 40 µs: adaptive, tolerance 1.0e-4"
    assert engines["other"][0] == f"≤ 1 ms (25{TIMES}): euler iterations=10, step 0.01 s"
    assert engines["other"][3] == "not reached (best 1.0e-8)"  # just so
    assert engines[ENGINE] == ["none measured (refused)"] * 4
    # Between 2e-2 and 1e-2: (1e-3 / 1e4)^(1/4) s, and 10 us for each step.
    a01 = {row[0]: row[1:] for row in cells_of(section(page, "Scene a01"))[1:]}
    assert a01["other"][1] == f"1.1 s (28{TIMES}): rk4, step 0.0178 s"


def test_every_method_has_its_row_in_the_appendix(page):
    rows = cells_of(section(page, "Appendix: what each method costs"))
    methods = {tuple(row[:2]): row[2:] for row in rows[1 : 1 + len(cost_data.METHODS)]}
    assert methods["ours", "rk4"] == [f"≤ 100 µs (2.5{TIMES})", f"110 µs (2.8{TIMES})", f"200 µs (5{TIMES})",
                                      "not reached (best 1.0e-8)"]  # fmt: skip
    assert methods["other", "euler iterations=10"][1:] == [
        f"10 ms ? (250{TIMES})",
        "not reached (best 1.0e-3)",
        NOTHING,
    ]


def test_the_cheapest_is_bold(page):
    bold = re.findall(r"\*\*([^*]+)\*\*", section(page, "Scene a01"))
    assert set(bold) == {"≤ 40 ms", "400 ms"}


def test_orders_show_what_is_claimed_and_what_is_seen(page):
    rows = {tuple(row[:2]): row[2:] for row in cells_of(section(page, "Orders"))[1:]}
    assert rows["ours", "rk4"] == ["4", "4.00", "4.00", "4.00"]
    assert rows["other", "euler iterations=10"][:2] == ["1", "1.00"]
    assert ("ours", "adaptive") not in rows
    # An error that should have been 1e-8, but is 1e-5: the order between the other two stays, and then it stops.
    worse = with_runs(results(scenes=("calm",), engines=("ours",)), {"error_max": 1e-5}, lambda case: case.dt == 1e-3)
    text = page_of(worse)
    rows = {tuple(row[:2]): row[2:] for row in cells_of(section(text, "Orders"))[1:]}
    assert rows["ours", "rk4"] == ["4", "4.00, stops at 1.0e-5"]
    assert "- calm: ours rk4: plateau: the error stops at 1.0e-05" in section(text, "What is odd")


def test_one_more_digit_costs_what_the_order_says(page):
    rows = {tuple(row[:2]): row[2:] for row in cells_of(section(page, "What one more digit costs"))[1:]}
    assert rows["ours", "rk4"] == ["4", *[f"1.8{TIMES}"] * 3]  # 10^(1/4)
    assert rows["ours", "adaptive"] == ["adaptive", *[f"1.8{TIMES}"] * 3]
    assert rows["other", "euler iterations=10"][1] == f"10{TIMES}"
    assert not any(name == ENGINE for name, _ in rows)  # two points say nothing of how sure a line is


def test_the_long_pendulum_has_its_section_where_it_is_part_of_the_study(page):
    rows = cells_of(section(page, "The pendulum of the benchmark A01"))
    assert rows[0] == ["engine", "to 1e-3 m", "smallest error", "of"]
    assert rows[1] == ["ours", "≤ 40 ms: adaptive, tolerance 1.0e-4", "1.0e-8", "ours adaptive tolerance=1e-08"]
    assert rows[3] == [ENGINE, "not reached (best 1.0e-2)", "1.0e-2", f"{ENGINE} -1+1`$\\frac$, step 0.001 s"]
    assert "pendulum of" not in page_of(results(scenes=("calm",)))


def test_reading_every_state_has_its_price(page):
    text = section(page, "For callers who read every state")
    assert f"11{TIMES} for ours" in text  # a step of 1 us, and 10 us to read
    [calm] = [row for row in cells_of(text) if row[0] == "calm"]
    # Ours is read at 50 samples, 12 us each; the other after each of 200 steps, 20 us each.
    assert calm[1] == "≤ 600 µs: adaptive, tolerance 1.0e-4"
    assert calm[2] == f"≤ 4 ms (6.7{TIMES}): rk4, step 0.01 s"


# What drifts.

STEADY = LongRun("ok", "", 10**6, 1e-6, 1e-6, 1e-12, 1e-4, 9e-7, 1e-6)


def verdict(**changes):
    return verdict_of(LongRow(Case(chain(2), "ours", "rk4", 2e-3), replace(STEADY, **changes)))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "no drift"),
        ({"energy_band_last_tenth": 8e-6}, "no drift"),
        ({"energy_band_last_tenth": 1e-5}, "no trend, but a band that grows"),
        ({"energy_band_first_tenth": 9e-6}, "no drift"),
        (
            {"energy_band_first_tenth": 0.3, "energy_band_last_tenth": 0.02, "energy_drift_max": 0.39},
            "leaves its energy early, by 0.39 of its scale",
        ),
        ({"energy_band_first_tenth": 0.0}, "no trend, but a band that grows"),
        ({"energy_drift_band": 0.39}, "no trend, but a band of 0.39 of its scale"),
        (
            {"energy_slope_share": 0.99, "energy_drift_slope_per_s": -2e-8, "energy_drift_max": 4e-5},
            "loses energy, up to 4.0e-5 of its scale",
        ),
        (
            {"energy_slope_share": 0.1, "energy_drift_slope_per_s": 2e-8, "energy_drift_max": 4e-5},
            "gains energy, up to 4.0e-5 of its scale",
        ),
        ({"energy_drift_band": 0.0, "energy_slope_share": NAN}, "no drift: the energy does not change at all"),
        ({"status": "warned", "reason": "unstable", "steps": 2112}, "warned after 2112 steps: unstable"),
        ({"status": "timed out", "reason": "", "steps": None}, "timed out: no reason given"),
        ({"energy_drift_band": NAN, "energy_slope_share": NAN}, NOTHING),
    ],
)
def test_verdicts_on_long_runs(changes, says):
    assert verdict(**changes) == says


def test_runs_that_are_alike_are_told_alike():
    """Two of one method, which lost as much: the one's last tenth has a half of the first's band, the other's less."""
    ours = {"energy_drift_max": 0.311, "energy_drift_band": 0.325, "energy_drift_slope_per_s": -1.6e-3,
            "energy_slope_share": 0.96, "energy_band_first_tenth": 0.049, "energy_band_last_tenth": 0.029}  # fmt: skip
    theirs = {**ours, "energy_drift_max": 0.296, "energy_slope_share": 1.08, "energy_band_last_tenth": 0.0028}
    assert verdict(**ours).replace("0.31", "0.3") == verdict(**theirs) == "loses energy, up to 0.3 of its scale"


@pytest.mark.parametrize(("first", "last"), [(8e-12, 4e-12), (4e-12, 8e-12)])
def test_two_stretches_of_a_chaotic_motion_are_no_loss(first, last):
    assert verdict(energy_band_first_tenth=first, energy_band_last_tenth=last) == "no drift"


def test_long_runs_are_rows_with_what_their_energy_does(page):
    rows = {tuple(row[1:3]): row[3:] for row in cells_of(section(page, "What drifts in long runs"))[1:]}
    assert rows["ours", "rk4"][-1] == "loses energy, up to 1.0e-6 of its scale"
    assert rows["other", "euler"][-1] == "no drift"
    assert rows[ENGINE, "-1+1`$\\frac$"][-1].startswith("crashed: =cmd")
    failed = section(page, "What was refused, and what failed")
    assert "Of the long runs:" in failed
    assert failed.count("**crashed**") == 1


# What to distrust.


def test_failures_are_in_the_table(page):
    failed = section(page, "What was refused, and what failed")
    assert "5 cases of 42 did not end well" in failed
    for status, reason in cost_data.FAILURES.values():
        assert status in failed
        assert markdown(reason) in failed


@pytest.mark.parametrize(
    ("truth", "says"),
    [
        (KeptTruth("timed out", "took longer than 20 s"), "the truth is not known (timed out: took longer than 20 s)"),
        (KeptTruth("ok", "ends at its horizon", 1.2, 1e-20, cost_data.np.array([0.0, 1.2]), cost_data.np.eye(2)),
         "the truth is known up to 1.2 s, and not to 2 s (ends at its horizon)"),
    ],
)  # fmt: skip
def test_a_truth_that_is_late_is_no_engine_s_error(truth, says):
    found = with_runs(results(scenes=("calm",), engines=("ours",)), {"error_max": NAN}, lambda _: True)
    found = replace(found, found=replace(found.found, truths={"calm": truth}))
    report = Report(found)
    for row in report.cases:
        assert (row.status, row.reason) == ("ok", f"not compared: {says}")
        assert row.measured.run.energy_drift_max > 0
    assert report.answer.startswith("None of the 6 cases")
    page = page_of(found)
    assert f"- calm: not compared: {says}" in section(page, "The scenes")
    assert "none measured (no error)" in section(page, "The answer")


def test_scene_in_which_nothing_moves_is_said_to_be_one_and_has_no_price():
    found = with_runs(
        results(scenes=("calm", "a01"), engines=("ours",)), {"error_max": 0.0}, lambda case: case.scene.n == 2
    )
    still = cost_data.np.full((2, 2), 1.5)
    truth = KeptTruth("ok", "", 2.0, 1e-25, cost_data.np.array([0.0, 2.0]), still, 0.0 * still, 0.0 * still)
    found = replace(found, found=replace(found.found, truths={**found.found.truths, "calm": truth}))
    report = Report(found)
    assert report.answer.startswith("Nothing moves in calm: it starts at rest, and nothing pulls it.")
    assert "the cheapest engine is ours in a01." in report.answer
    assert {row.flags for row in report.cases if row.case.scene.name == "calm"} == {"nothing moves"}
    assert all(plot.png.startswith(PNG) for plot in report.pictures)
    odd = section(page_of(found), "What is odd")
    assert "too good" not in odd


def test_flags_of_all_steps_are_said_once_and_timings_are_not_among_them():
    found = with_runs(results(scenes=("calm",), engines=("ours",)), {"error_max": 0.0}, lambda case: case.dt == 1e-3)
    found = with_runs(found, {"error_max": 2e-3}, lambda case: case.dt == 2e-2)
    assert all(plot.png.startswith(PNG) for plot in Report(found).pictures)
    odd = section(page_of(with_timings(found, step_spread=0.4)), "What is odd")
    assert odd.count("ours rk4: order 4.3 where 4 is claimed") == 1  # log2(2e-3 / 1e-4) = 4.32
    assert odd.count("ours rk4, step 0.001 s: too good: no error at all") == 1
    assert "noisy" not in odd


def test_the_page_names_what_is_noisy(page):
    assert "Nothing: no result is too good to be true" in section(page, "What is odd")
    trust = section(page, "Appendix: how far to trust the timings")
    assert "calm: other euler iterations=10, step 0.001 s: spread 50%" in trust
    assert trust.count("spread 50%") == 1


def test_runs_too_short_to_time_are_counted(page):
    text = "less than 100 µs to the time of comparison"
    # Ours for two seconds: 40 us; for one: 20, 64 and 50 us. What takes 100 us is not among them.
    short = sum(0 < row.timing.run_s < 1e-4 for row in (row.measured for row in Report(results()).cases))
    assert f"{short} cases take {text}" in page
    assert short == 4
    assert text not in page_of(results(scenes=("a01",)))


# The answer: every sentence from the numbers that its tables show.


def test_the_answer_says_who_how_much_and_where_not():
    first, others, pairs = answer(results(scenes=("calm", "a01"))).split(". ")
    assert first == "For an error up to 1e-4 of the chain's length, the cheapest engine is ours in calm and a01"
    assert f"Compared with the cheapest, other takes 50{TIMES} as long; " in others
    assert others.endswith("does not get there in calm and a01")
    assert pairs == "Of 8 pairs of scene and accuracy, ours is the cheapest in 8."


def test_the_answer_is_made_from_the_numbers():
    # In a01 50 times as long; in calm 2 ms where ours takes a hundred times its 40 us.
    text = answer(results(scenes=("calm", "a01"), engines=("ours", "other"), dear=100.0))
    assert "the cheapest engine is other in calm, ours in a01." in text
    assert f"Compared with the cheapest, ours takes 2{TIMES} as long; other takes 50{TIMES} as long." in text
    assert "Of 8 pairs of scene and accuracy, ours is the cheapest in 5, other is the cheapest in 3." in text


def ratios_of(page, engine):
    """The ratios to the cheapest that the first table of the page shows for an engine."""
    heading, *lines = cells_of(section(page, "The answer"))
    cells = [line[heading.index(engine)] for line in lines]
    return [cell.split("(")[1].split(")")[0] for cell in cells if TIMES in cell]


@pytest.mark.parametrize("dear", [0.3, 1.0, 7.0, 100.0])
def test_the_answer_s_numbers_stand_in_the_table_below_it(dear):
    found = results(scenes=("calm", "a01"), engines=("ours", "other"), dear=dear)
    text, page = answer(found), page_of(found)
    told = dict(re.findall(rf"(\w+) takes ([\d.{TIMES} to]+) as long", text))
    for engine in ("ours", "other"):
        shown = sorted(set(ratios_of(page, engine)), key=lambda ratio: float(ratio.rstrip(TIMES)))
        assert told.get(engine, "") == " to ".join([*shown[:1], *shown[1:][-1:]])
    lines = [line for scene in ("calm", "a01") for line in cells_of(section(page, f"Scene {scene}"))]
    cells = [cell for engine, *own in lines if engine == "ours" for cell in own]
    wins = sum(TIMES not in cell and "not reached" not in cell for cell in cells)
    assert f"ours is the cheapest in {wins}" in text


def test_noise_is_said_beside_the_number_it_spoils():
    found = results(scenes=("calm",), engines=("ours", "other"))
    assert "noisy" not in answer(found)
    noisy = with_timings(found, step_spread=0.4)
    assert f"other takes 50{TIMES} as long (noisy)." in answer(noisy)
    assert f"≤ 2 ms ? (50{TIMES})" in section(page_of(noisy), "The answer")


@pytest.mark.parametrize("engine", ["ours", "other"])
def test_a_ratio_is_noisy_where_either_of_its_numbers_is(engine):
    found = results(scenes=("calm",), engines=("ours", "other"))
    assert f"other takes 50{TIMES} as long (noisy)." in answer(retimed(found, engine, step_spread=0.4))


def retimed(of, engine, dt=None, method=None, **change):
    """The results with changes to the timings of an engine, or of its cases with that step and method alone."""
    timings = {
        case: replace(timing, **change)
        if case.engine == engine and dt in (None, case.dt) and method in (None, case.method)
        else timing
        for case, timing in of.found.timings.items()
    }
    return replace(of, found=replace(of.found, timings=timings))


def facts_of(of):
    report = Report(of)
    return facts(of, report.tables)


def test_what_reading_costs_is_the_median_of_the_steps():
    """Twice as much with rk4, three times with Euler's three steps; one that reads for 100 us is one of five."""
    found = results(scenes=("calm",), engines=("other",), methods=("rk4", "euler"))
    slow = retimed(found, "other", 1e-3, method="rk4", step_and_state_us=100.0)
    assert facts_of(slow).dearer == [("other", 3.0)]


def test_who_is_the_cheapest_in_most_scenes_is_named_first():
    found = facts_of(results(engines=("ours", "other"), dear=100.0))
    assert [(each.engine, each.scenes) for each in found.winners] == [("ours", ["a01", SCENE]), ("other", ["calm"])]


def test_what_moves_is_the_cheapest_of_each_engine_that_is_accurate_enough():
    """To 1e-4: our loosest tolerance, 40 us, and the other's rk4 with 10 ms, 2 ms; its Euler is cheaper and worse."""
    shown = Report(results(scenes=("calm",), engines=("ours", "other"))).moving
    assert [(case.engine, case.method, case.dt, case.settings) for case in shown] == [
        ("ours", "adaptive", None, (("tolerance", 1e-4),)), ("other", "rk4", 1e-2, ())
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"failing": True}, "None of the 42 cases of this study reached an error of 1e-4"),
        ({"engines": ()}, "None of the 0 cases"),
        ({"engines": ("ours",)}, "the cheapest engine is ours in calm"),
        ({"methods": ("euler",)}, "None of the 9 cases"),
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
    "no long runs": {"scenes": ("a01",)},
    "no cases": {"engines": ()},
    "no scenes": {"scenes": ()},
    "quick": {"scenes": ("calm",), "quick": True},
}


@pytest.mark.parametrize("changes", PARTIAL.values(), ids=PARTIAL)
def test_partial_results_are_reported(changes, tmp_path):
    found = results(**changes)
    write_report(Report(found), tmp_path)
    page = (tmp_path / "report.md").read_text("utf-8")
    assert "## Appendix: where the numbers come from" in page
    for plot in re.findall(r"\((plots/[^)]*)\)", page):
        assert (tmp_path / plot).is_file()
    assert render(summary_table(Report(found)))
    assert not re.search(r"\bnan\b", page)
    assert ("quick variant" in page) == bool(changes.get("quick"))


def test_where_all_failed_every_table_says_so():
    failed = results(scenes=("calm",), failing=True)
    page = page_of(failed)
    assert "none measured (error)" in section(page, "Scene calm")
    assert "14 cases of 14 did not end well" in section(page, "What was refused, and what failed")
    assert "the truth of calm: **timed out**: too slow" in section(page, "What was refused, and what failed")
    assert "For callers" not in page
    assert not Report(failed).pictures
    assert HOSTILE.split("\n", maxsplit=1)[0] not in page  # not as it stands
    assert math.isnan(Report(results(failing=True)).tables["prices"].rows[0].price.run_s)
