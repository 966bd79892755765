"""The report of a study of kind `chaos`: what it says is what its tables show."""

from __future__ import annotations

import dataclasses
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from pendbench.kinds.chaos.answer import Standing
from pendbench.kinds.chaos.causes import twins
from pendbench.kinds.chaos.columns import tables
from pendbench.kinds.chaos.rows import CaseRow
from pendbench.kinds.chaos.work import ChaosRun
from pendbench.measures.divergence import Crossing
from pendbench.report.numbers import NOTHING
from pendbench.report.page import Report
from pendbench.report.start import start_text, turns_at_start
from pendbench.report.write import write_report
from pendbench.study.timing import Timed
from pendbench.study.truths import KeptTruth
from support import report_data
from support.reading import cells_of, section
from support.report_data import ENGINE, NAN, SCENE, changed, report, results, scene_of


@pytest.fixture(scope="module")
def page():
    return text_of(report())


def text_of(made: Report) -> str:
    """A page; its plots are not drawn."""
    return made.markdown()


def rows_of(page: str, heading: str) -> list[dict[str, str]]:
    """The first table under a heading, a row as cells by its headings."""
    heads, *rows = cells_of(section(page, heading))
    return [dict(zip(heads, row, strict=True)) for row in rows if len(row) == len(heads)]


def best(page: str) -> dict[str, dict[str, str]]:
    """The table of the best of each engine, by engine."""
    return {row["engine"]: row for row in rows_of(page, "The answer")}


def with_runs(change):
    """The report of the results with each run of each case changed."""
    found = results().found
    return changed(runs={case: [change(case, run) for run in runs] for case, runs in found.runs.items()})


# The answer


def test_the_page_has_its_parts_in_order(page):
    headings = re.findall(r"^## (.*)$", page, flags=re.MULTILINE)
    assert [heading for heading in headings if not heading.startswith("Scene ")] == [
        "The answer",
        "The scenes",
        "Why they leave the truth",
        "What staying with the truth costs",
        "The causes, scene by scene",
        "What was refused, and what failed",
        "Appendix: how far to trust the timings",
        "Appendix: how it was measured",
        "Appendix: what the columns mean",
        "Appendix: where the numbers come from",
    ]


@pytest.mark.parametrize("chosen", [{}, {"scenes": ("wild",)}, {"scenes": ("calm",)}, {"engines": ("ours", "other")}])
def test_every_number_of_the_answer_stands_in_the_table_below_it(chosen):
    made = report(**chosen)
    rows = [dict(zip(*pair, strict=True)) for pair in ((cells_of(section(text_of(made), "The answer"))[0], row)
            for row in cells_of(section(text_of(made), "The answer"))[1:])]  # fmt: skip
    told = re.findall(
        r"(\S+ )?(\S+)(?:, step (\S+) s)?(?: stays| \(and|:)[^;]*?(\d+%)[^;]*?, at (\S+) ms([^;.]*)", made.answer
    )
    assert len(told) == len(rows)
    for (_, name, step, share, cost, after), row in zip(told, rows, strict=True):
        assert name == row["method"]
        assert (step or "its own") == row["step, s"]
        assert share == row["stays for, of the horizon"]
        assert cost == row["ms per simulated s"]
        assert ("noisy" in after) == (row["timing"] == "noisy")


def test_the_longest_is_first_and_the_cheapest_of_those_that_stay_as_long(page):
    rows = list(best(page).values())
    assert [row["engine"] for row in rows] == ["other", "ours", ENGINE]
    assert [row["stays for, of the horizon"] for row in rows] == ["100%", "100%", "35%"]
    # rk4 with 0.01 s leaves "wild" after ln(1e-2 / 1e-6) / 2 per s = 4.6 s of 8, and costs a tenth.
    assert rows[0]["step, s"] == "0.001"
    assert (
        "other rk4, step 0.001 s stays within 1e-2 of the truth longest (and ours adaptive as long)" in report().answer
    )


def test_regular_scenes_do_not_count_where_there_are_chaotic_ones():
    assert report().answer.startswith("In the 2 chaotic scenes")
    assert report(scenes=("calm", "wild")).answer.startswith("In the chaotic scene wild")
    assert report(scenes=("calm",)).answer.startswith("In the regular scene calm")


def test_shares_of_the_horizon_are_those_of_each_start_by_its_own_horizon():
    """A start with a late horizon can leave the truth later than another one's horizon; that is no share above 1."""
    made = report_data.found(scenes=("wild",), engines=("ours",))
    case = next(case for case in made.cases if case.dt == 1e-2)
    times, horizons = (2.0, 4.5, 10.0), (8.0, 5.0, 20.0)  # 25 %, 90 %, 50 %
    runs = [ChaosRun("ok", crossings=(None, Crossing(time, time, time), None)) for time in times]
    truths = [dataclasses.replace(truth, horizon=horizon) for truth, horizon in
              zip(made.truths["wild"], horizons, strict=True)]  # fmt: skip
    row = next(row for row in tables(results_of(made, runs={**made.runs, case: runs}, truths={"wild": truths}))[0]
               if row.case is case)  # fmt: skip
    assert row.share == 0.5


def results_of(made, **fields):
    return dataclasses.replace(results(), found=dataclasses.replace(made, **fields))


def test_a_share_is_the_mean_of_the_scenes():
    """1e-2 in "wild" after 6.907 s of 8 and in the other after 13.8 s, which is not before its horizon."""

    def slower(case, run):
        keep = (case.engine, case.method) == ("ours", "adaptive") and case.scene.name == "wild"
        return dataclasses.replace(run, crossings=(Crossing(2.0, 2, 2),) * 3) if keep else run

    row = best(text_of(with_runs(slower)))["ours"]
    assert row["method"] == "rk4"  # 100 % of both
    found = report_data.found(engines=("ours",))
    only = [case for case in found.cases if case.method == "adaptive"]
    runs = {case: [slower(case, run) for run in found.runs[case]] for case in only}
    shown = results_of(found, cases=tuple(only), runs=runs)
    row = best(text_of(Report(shown)))["ours"]
    assert row["stays for, of the horizon"] == "62%"  # (2 s of 8, and all of 10 s) / 2
    assert row["leaves after, s"] == f"2 in wild; not before the horizon in {SCENE!s}".replace("\n", "\\n")


def test_an_engine_that_never_stays_is_named():
    assert report(failing=True).answer == (
        f"No case of {ENGINE}, other and ours stayed with the truth for a time that could be measured."
    )


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"engines": ("ours",)}, "No other engine took part."),
        ({"engines": ()}, "There was nothing to compare."),
        ({"scenes": ()}, "There was nothing to compare."),
    ],
)
def test_answers_to_partial_results(changes, says):
    assert says in report(**changes).answer


# Where nothing moves


def still(*names):
    """The results with nothing moving in these scenes."""
    truths = dict(results().found.truths)
    for name in names:
        truths[name] = [
            dataclasses.replace(truth, theta=0 * truth.theta + scene_of(name).angles) for truth in truths[name]
        ]
    return changed(truths=truths)


def test_where_nothing_moves_that_is_all_that_is_said():
    made = still(*report_data.SCENES)
    assert made.answer.split(". ")[:2] == [
        f"Nothing moves in {name}: it starts at rest, and nothing pulls it".replace("\n", "\\n")
        for name in ("calm", "wild")
    ]
    assert "longest" not in made.answer
    assert made.tables["cases"].rows[0].flags == "nothing moves"
    assert {row.method.cause for row in made.tables["cases"]} == {"none: nothing moves"}
    assert "cost" not in {plot.name for plot in made.pictures}


def place(name, median, later=False):
    left = SimpleNamespace(median=median, median_is_later=later)
    return SimpleNamespace(left=left, case=SimpleNamespace(scene=SimpleNamespace(name=name)))


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([place("a", 1.0), place("b", 2.0)], "1 to 2"),
        ([place("a", math.nan, later=True)], "not before the horizon"),
        ([place("a", 1.0), place("b", math.nan, later=True)], "1 in a; not before the horizon in b"),
        ([place(name, 3.0) for name in "abc"] + [place("d", math.nan)], "3 in 3 scenes; not known in d"),
    ],
)
def test_when_it_leaves_the_truth_names_scenes_where_they_differ(rows, said):
    assert Standing(rows, len(rows)).leaves == said


@pytest.mark.parametrize(("speed", "cost"), [(0.5, 2000.0), (4.0, 250.0), (math.nan, None), (0.0, None)])
def test_a_simulated_second_costs_a_second_over_the_speed(speed, cost):
    row = SimpleNamespace(timing=SimpleNamespace(simulated_s_per_s=speed))
    found = CaseRow.cost_ms.fget(row)
    assert math.isnan(found) if cost is None else found == cost


@pytest.mark.parametrize(
    ("costs", "noisy", "said"),
    [
        ([2.0, math.nan], [False, False], "steady"),
        ([2.0, 3.0], [False, True], "noisy"),
        ([math.nan], [False], "not timed"),
    ],
)
def test_what_costs_are_worth(costs, noisy, said):
    rows = [
        SimpleNamespace(cost_ms=cost, timing=SimpleNamespace(noisy=own)) for cost, own in zip(costs, noisy, strict=True)
    ]
    assert Standing(rows, len(rows)).timing == said


def test_scenes_in_which_nothing_moves_do_not_count():
    made = still("wild")
    assert "In the chaotic scene ../a|b" in made.answer
    assert made.answer.startswith("Nothing moves in wild")
    assert all(("nothing moves" in row.flags) == (row.case.scene.name == "wild") for row in made.tables["cases"])


# The scenes


def test_the_start_is_shown_in_radians_and_in_degrees(page):
    rows = {row["scene"]: row for row in rows_of(page, "The scenes")}
    assert rows["wild"]["start"] == "1 rad (57.3°)"
    scene = scene_of("wild")
    assert (
        start_text(scene.with_start([0.0, math.pi / 2, -math.pi], [0, 0, 0])) == "0, 1.57, -3.14 rad (0°, 90°, -180°)"
    )
    assert start_text(scene.with_start([1.0] * 3, [0.0, 2.0, 0.0])) == "1 rad (57.3°), 0, 2, 0 rad/s"


def test_a_start_of_many_turns_asks_back(page):
    assert "were degrees meant" not in page
    found = results().found
    scenes = tuple(
        scene.with_start(scene.angles * (135 if scene.name == "wild" else 1), scene.rates) for scene in found.scenes
    )
    assert [turns_at_start(scene) for scene in scenes] == [0.0, pytest.approx(135 / (2 * np.pi)), 0.0]
    asked = section(text_of(changed(scenes=scenes)), "The scenes")
    assert "**wild** starts 21.5 turns from the vertical" in asked
    assert asked.count("were degrees meant?") == 1


def test_what_the_scenes_are_stands_in_their_table(page):
    rows = {row["scene"]: row for row in rows_of(page, "The scenes")}
    assert rows["wild"]["horizon, s"] == "8 (7.5 to 8 over the starts)"
    assert rows["calm"]["horizon, s"] == "10, the scene's end (9.5 to 10 over the starts)"
    assert rows["wild"]["in Lyapunov times"] == "16"  # 8 s of 2 per s
    assert rows["calm"]["in Lyapunov times"] == NOTHING
    assert (rows["calm"]["motion"], rows["wild"]["motion"]) == ("regular", "chaotic")
    assert "2 perturbed ones" in section(page, "The scenes")


def test_a_scene_without_a_truth_says_so():
    found = results().found
    lost = {name: [KeptTruth("timed out", "too slow")] * 3 for name in found.truths}
    runs = {
        case: [dataclasses.replace(run, crossings=(), error_max=NAN) for run in own] for case, own in found.runs.items()
    }
    page = text_of(changed(truths=lost, runs=runs))
    assert "There is no truth to compare with: **timed out**: too slow." in page
    assert "the truth of wild: **timed out**: too slow" in section(page, "What was refused, and what failed")
    assert "not compared, for want of a truth: too slow" in page


# The cases


def test_times_show_the_median_and_the_extremes(page):
    row = next(row for row in rows_of(page, "Scene wild") if (row["engine"], row["method"], row["step, s"]) ==
               ("ours", "rk4", "0.01"))  # fmt: skip
    assert row["to 1e-2, s"] == "4.61 [4.14 .. 5.07]"  # ln(1e-2 / 1e-6) / 2 per s, a tenth less and a tenth more
    assert row["Lyapunov times"] == "6.91 / 9.21 / 11.5"
    assert row["e to half horizon"] == "1.0e-8"


def test_what_is_missing_is_said_in_words(page):
    calm, wild = rows_of(page, "Scene calm"), rows_of(page, "Scene wild")
    assert calm[-1]["to 1e-2, s"] == wild[-1]["to 1e-2, s"] == "not before the horizon"
    assert {row["Lyapunov times"] for row in calm if "ok" in row["status and flags"]} == {"regular motion"}
    assert wild[-1]["Lyapunov times"] == "> 16 / > 16 / > 16"
    assert any(row["to 1e-2, s"] == NOTHING for row in wild)


@pytest.mark.parametrize(
    ("times", "shown"),
    [
        ((2.0, 1.0, None), "2 [1 .. not before the horizon]"),
        ((1.0, None, None), "not before the horizon [1 ..]"),
        ((None, None, None), "not before the horizon"),
        ((2.0, 2.0, 2.0), "2"),
        ((3.0, 1.0, 2.0), "2 [1 .. 3]"),
    ],
)
def test_a_time_that_only_some_starts_have_says_so(times, shown):
    found = report_data.found(scenes=("wild",), engines=("ours",))
    crossings = [None if time is None else Crossing(time, time, time) for time in times]
    runs = {case: [ChaosRun("ok", crossings=(crossing,) * 3) for crossing in crossings] for case in found.cases}
    page = text_of(Report(results_of(found, runs=runs)))
    assert rows_of(page, "Scene wild")[0]["to 1e-2, s"] == shown


def test_engines_are_compared_at_equal_accuracy(page):
    rows = {(row["scene"], row["engine"]): row for row in rows_of(page, "What staying with the truth costs")}
    # Half of the horizon is 4 s: rk4 with 0.01 s stays for 4.6 s and costs a tenth of what the finer step does.
    found = rows["wild", "ours"]
    assert [found[name] for name in ("up to, s", "cheapest case", "ms per simulated s", "timing")] == [
        "4", "ours rk4, step 0.01 s", "1", "steady",
    ]  # fmt: skip
    assert rows["wild", ENGINE]["cheapest case"] == "none of its cases"  # torn after 1.15 s, and crashed
    assert rows["calm", "other"]["cheapest case"] == "other rk4, step 0.01 s"


def test_a_noisy_price_says_so():
    found = results().found
    timings = {case: dataclasses.replace(timing, step_spread=0.5) for case, timing in found.timings.items()}
    rows = rows_of(text_of(changed(timings=timings)), "What staying with the truth costs")
    assert {row["timing"] for row in rows if row["cheapest case"] != "none of its cases"} == {"noisy (50%)"}


def test_noise_is_named_in_the_appendix(page):
    timings = section(page, "Appendix: how far to trust the timings")
    assert "- calm: other rk4, step 0.001 s: spread 50%" in timings
    assert timings.count("spread 50%") == 3
    assert "24 cases of 27 were timed" in timings
    assert "2 cases that did not end well were timed all the same" in timings


# Why they leave


def test_the_methods_say_which_system_they_simulate_and_their_orders(page):
    rows = {(row["engine"], row["method"]): row for row in rows_of(page, "Why they leave the truth")}
    ours = rows["ours", "rk4"]
    assert (ours["model error"], ours["system"], ours["order claimed"], ours["orders seen"]) == (
        "1.0e-12", "the same", "4", "3.99",
    )  # fmt: skip
    assert rows[ENGINE, report_data.METHOD]["system"] == "another"
    assert rows[ENGINE, report_data.METHOD]["model error"] == "2.0e-3"


def test_a_plateau_is_told_with_its_level():
    def flat(case, run):
        return (
            dataclasses.replace(run, order_error=2e-3) if case.engine == "other" and case.scene.name == "wild" else run
        )

    rows = {
        (row["engine"], row["method"]): row for row in rows_of(text_of(with_runs(flat)), "Why they leave the truth")
    }
    assert rows["other", "rk4"]["the error stops at"] == "2.0e-3 in wild"
    assert rows["ours", "rk4"]["the error stops at"] == ""


def test_programs_with_the_same_errors_are_told_apart_from_others():
    def larger(_, run, factor=1.0):
        return dataclasses.replace(run, error_half=1e6 * factor * run.error_half)

    cases = list(with_runs(larger).tables["cases"])
    assert twins(cases) == [["other rk4", "ours rk4"]]
    one_off = with_runs(lambda case, run: larger(case, run, 1.01 if case.engine == "ours" else 1.0))
    assert twins(list(one_off.tables["cases"])) == []


def test_growth_is_compared_with_what_chaos_does(page):
    """In "wild" five cases stay for 5 Lyapunov times of 0.5 s, and their errors grow as chaos has it, at 2 per s."""
    table = cells_of(section(page, "Why they leave the truth").split("What chaos does")[1])
    assert table[1] == ["wild", "2", "5", "2", "1", "5 of 5"]

    def faster(case, run):
        return dataclasses.replace(run, growth=run.growth * (3 if case.dt == 1e-3 else 1.2))

    table = cells_of(section(text_of(with_runs(faster)), "Why they leave the truth").split("What chaos does")[1])
    assert table[1] == ["wild", "2", "5", "2.4 to 6", "1.2 to 3", "3 of 5"]


def test_no_chaos_no_growth():
    assert "No scene is chaotic" in text_of(report(scenes=("calm",)))


# What goes wrong


def test_failures_are_in_every_table(page):
    failed = section(page, "What was refused, and what failed")
    assert "5 cases of 27 did not end well" in failed
    wild = section(page, "Scene wild")
    assert all(f"**{status}**" in wild for status in ("not finite", "timed out", "torn", "crashed"))
    assert "**refused**" in section(page, "Scene calm")


def test_nobody_needs_curves_or_timings(tmp_path):
    found = results().found
    runs = {
        case: [dataclasses.replace(run, curves=type(run.curves)()) for run in own] for case, own in found.runs.items()
    }
    made = changed(runs=runs, timings={case: Timed("timed out", "slow") for case in found.timings})
    write_report(made, tmp_path)
    page = (tmp_path / "report.md").read_text("utf-8")
    assert not (tmp_path / "plots").exists()
    assert "Nothing was timed" in page
    assert not re.search(r"\bnan\b", page)
