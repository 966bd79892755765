"""The cost study: prices against points whose answer is known, and a small study from its file to its tables."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cost_data
from controls import Lazy, Oracle, Picky, Raising, Single
from pendbench.engines import registry
from pendbench.errors import InputError
from pendbench.report.columns import COLUMNS, column
from pendbench.study.baseline import read_baseline, regressions, write_baseline
from pendbench.study.case import Case
from pendbench.study.cost import Window, series_of, step_of, times_of, tolerance_of
from pendbench.study.flags import of_priced_row
from pendbench.study.jobs import Outcome
from pendbench.study.measure import Price, price_of, price_of_digit
from pendbench.study.plan import load_plan
from test_chaos_study import FIXED
from tiny_study import Idle, Inline, Log, run, write_study

STEPS = np.array([0.1, 0.05, 0.02, 0.01])
FLOOR, CEILING = 1e-12, 0.03


def method(order: float, steps=STEPS):
    """Step, error and cost of a method that is what it claims to be: e = h^p, and a cost of 1/h."""
    return steps, steps**order, 1 / steps


# The price of an accuracy.


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("share", [0.999, 0.5, 0.1001])
def test_a_price_between_two_steps_is_that_of_the_step_between_them(order, share):
    step = 0.1 * share
    price = price_of(step**order, *method(order))
    assert price.step == pytest.approx(step, rel=1e-12)  # a power law is a straight line of logarithms
    assert price.run_s == pytest.approx(1 / step, rel=1e-12)
    assert not price.bound
    assert price.best == pytest.approx(0.01**order)


def test_the_coarsest_step_that_is_good_enough_is_an_upper_bound():
    assert price_of(0.5, *method(1)) == Price(10.0, 0.1, 0.01, bound=True)
    assert price_of(0.1, *method(1)) == Price(10.0, 0.1, 0.01, bound=True)  # just so


def test_what_no_step_reaches_has_no_price_but_a_best_error():
    price = price_of(1e-5, *method(2))
    assert math.isnan(price.run_s)
    assert math.isnan(price.step)
    assert price.best == pytest.approx(1e-4)  # the finest step promises more; nothing is made of that
    assert not price.bound


def test_what_was_not_measured_has_neither():
    for points in (np.zeros((3, 0)), np.array([[0.1], [np.nan], [1.0]])):
        assert np.isnan(price_of(1e-3, *points)[:3]).all()


def test_a_failed_step_is_no_point_to_start_from():
    steps, errors, costs = method(2)
    errors[0] = np.nan
    assert price_of(2.6e-3, steps, errors, costs) == Price(20.0, 0.05, 1e-4, bound=False)


def test_an_error_of_nothing_cannot_be_interpolated_to():
    assert price_of(1e-3, STEPS, np.array([0.1, 0.0, 0.0, 0.0]), 1 / STEPS) == Price(20.0, 0.05, 0.0, bound=False)


POINTS = st.lists(
    st.tuples(st.floats(1e-6, 1.0), st.floats(1e-14, 10.0) | st.just(math.nan), st.floats(1e-6, 1e3)),
    min_size=1,
    max_size=8,
    unique_by=lambda point: point[0],
)


@given(POINTS, st.floats(1e-12, 1.0), st.randoms())
def test_prices_are_never_beyond_what_was_measured_and_do_not_depend_on_the_order(points, accuracy, random):
    steps, errors, costs = np.array(sorted(points, reverse=True)).T
    price = price_of(accuracy, steps, errors, costs)
    shuffled = random.sample(points, len(points))
    assert repr(price_of(accuracy, *np.array(shuffled).T)) == repr(price)
    good = np.flatnonzero(errors <= accuracy)
    assert np.isfinite(price.run_s) == bool(len(good))
    if len(good):
        pair = slice(max(good[0] - 1, 0), good[0] + 1)
        assert costs[pair].min() * (1 - 1e-9) <= price.run_s <= costs[pair].max() * (1 + 1e-9)
        assert steps[good[0]] * (1 - 1e-9) <= price.step <= steps[pair].max() * (1 + 1e-9)


# The price of one more digit.


@pytest.mark.parametrize(("order", "price"), [(1, 10.0), (2, math.sqrt(10)), (4, 10**0.25)])
def test_a_digit_costs_what_the_order_says(order, price):
    _, errors, costs = method(order, np.array([1e-2, 5e-3, 2e-3, 1e-3]))
    assert price_of_digit(errors, costs, FLOOR, CEILING) == pytest.approx(price)


def test_rounding_and_large_errors_do_not_count():
    errors = np.array([0.9, 1e-2, 1e-4, 1e-6, 1e-13, np.nan])
    costs = np.array([100.0, 1.0, 10.0, 100.0, 1e6, 1e9])
    assert price_of_digit(errors, costs, FLOOR, CEILING) == pytest.approx(math.sqrt(10))


@pytest.mark.parametrize(
    ("errors", "costs"),
    [
        ([], []),
        ([1e-3], [1.0]),
        ([1e-3, 0.5, 1e-14], [1.0, 2.0, 3.0]),  # one usable point
        ([1e-3, 0.9e-3, 0.7e-3], [1.0, 2.0, 3.0]),  # not even halved
        ([1e-5, 1e-3], [1.0, 2.0]),  # more cost, more error
        ([np.nan, np.nan], [1.0, 2.0]),
    ],
)
def test_without_a_falling_error_a_digit_has_no_price(errors, costs):
    assert math.isnan(price_of_digit(np.array(errors), np.array(costs), FLOOR, CEILING))


# The study's file.

HEAD = """
title      = "What does it cost?"
kind       = "cost"
scenes     = ["double.toml"]
accuracies = [1e-2, 1e-3, 1e-4, 1e-6]

[windows]
double = { time = 0.5, samples = 20 }

[long_runs]
scenes = ["double"]
steps  = 1000
dt     = 1e-3
"""
ENGINES = """
[[engines]]
name      = "analytic"
methods   = ["adaptive"]
tolerance = [1e-5, 1e-8, 1e-11]

[[engines]]
name    = "analytic"
methods = ["rk4"]
dt      = [2e-2, 1e-2, 5e-3, 25e-4]

[[engines]]
name    = "mujoco"
methods = ["euler"]
dt      = [1e-2, 5e-3, 25e-4]

[[engines]]
name       = "pymunk"
methods    = ["tuned"]
dt         = [1e-2, 5e-3]
iterations = [10, 20]
"""
CONTROLS = """
[[engines]]
name    = "single"
methods = ["rk4"]
dt      = [1e-2, 5e-3, 25e-4]

[[engines]]
name    = "oracle"
methods = ["rk4"]
dt      = [1e-2]

[[engines]]
name    = "lazy"
methods = ["adaptive"]

[[engines]]
name    = "picky"
methods = ["rk4"]
dt      = [1e-2]

[[engines]]
name    = "raising"
methods = ["rk4"]
dt      = [1e-2]
"""


def study_file(folder: Path, head: str = HEAD, engines: str = ENGINES) -> Path:
    return write_study(folder, engines, head)


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("double = { time", "doubl = { time", "[windows]: missing key 'double', one of the study's scenes"),
        ("time = 0.5", "time = 2.5", "[windows.double]: time is 2.5; allowed: up to 2 s"),
        ('scenes = ["double"]', 'scenes = ["duoble"]', "unknown scene 'duoble'; did you mean 'double'?"),
        ("steps  = 1000", "steps  = 10", "steps"),
        ("samples = 20", "samples = 0", "samples"),
        ("time = 0.5", "time = inf", "time"),
        ("accuracies = [1e-2, 1e-3, 1e-4, 1e-6]", "accuracies = [2.0]", "accuracies"),
    ],
)
def test_a_file_that_cannot_be_used_is_one_line(tmp_path, before, after, says):
    assert before in HEAD
    path = study_file(tmp_path, HEAD.replace(before, after))
    with pytest.raises(InputError) as caught:
        run(path, tmp_path / "out", Idle)
    message = str(caught.value)
    assert says in message
    assert message.startswith(str(path))
    assert len(message.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    return load_plan(study_file(tmp_path_factory.mktemp("plan")))


@pytest.mark.parametrize("dt", [None, 0.5, 0.02, 0.03, 0.0123, 1e-4])
def test_cases_are_compared_on_whole_steps_of_their_own(plan, dt):
    case = Case(plan.scenes[0], "analytic", "rk4", dt)
    times = times_of(case, Window(time=0.5, samples=20))
    assert times[0] == 0.0
    assert np.all(np.diff(times) > 0)
    even = np.linspace(0.0, 0.5, 21)
    if dt is None:
        assert times == pytest.approx(even, abs=1e-12)
    else:
        assert times / dt == pytest.approx(np.rint(times / dt), abs=1e-6)
        assert all(np.abs(times - t).min() <= 0.5 * dt + 1e-9 for t in even)
        assert len(times) <= 21


def test_cases_that_differ_in_step_or_tolerance_alone_are_one_series(plan):
    found = {key: list(cases) for key, cases in itertools.groupby(plan.cases, series_of)}
    assert [(*key[1:], len(cases)) for key, cases in found.items()][:3] == [
        ("analytic", "adaptive", "", 3),
        ("analytic", "rk4", "", 4),
        ("mujoco", "euler", "", 3),
    ]
    tuned = {series_of(case) for case in plan.cases if case.engine == "pymunk"}
    assert tuned == {("double", "pymunk", "tuned", "iterations=10"), ("double", "pymunk", "tuned", "iterations=20")}


def test_the_step_of_a_method_without_one_is_its_tolerance(plan):
    scene = plan.scenes[0]
    given = Case(scene, "analytic", "adaptive", None, (("tolerance", 1e-5),))
    assert (step_of(given), tolerance_of(given)) == (1e-5, 1e-5)
    assert (
        step_of(Case(scene, "analytic", "adaptive", None))
        == registry.engine("analytic").methods["adaptive"].settings["tolerance"].default
    )
    fixed = Case(scene, "analytic", "rk4", 1e-2)
    assert step_of(fixed) == 1e-2
    assert math.isnan(tolerance_of(fixed))


# A small study, with engines in it that are wrong.


@pytest.fixture(scope="module")
def known():
    """The engines that are wrong, known to this process for as long as these tests last."""
    with pytest.MonkeyPatch.context() as patch:
        for control in (Single, Oracle, Lazy, Picky, Raising):
            patch.setitem(registry._registered, control.name, control)
        yield


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return study_file(tmp_path_factory.mktemp("study"), engines=ENGINES + CONTROLS)


@pytest.fixture(scope="module")
def done(known, study, tmp_path_factory):  # noqa: ARG001
    """The study, run; its log."""
    log = Log()
    return run(study, tmp_path_factory.mktemp("out"), Inline, log=log, report=True), log


def rows(done, table="cases", **wanted) -> pd.DataFrame:
    results = done[0].results
    found = results.cases if table == "cases" else results.tables[table]
    for name, value in wanted.items():
        found = found[found[name] == value]
    assert len(found), (table, wanted)
    return found


def test_every_case_is_a_row_and_every_column_is_declared(done):
    finished, log = done
    assert set(FIXED) <= set(finished.results.cases)
    for name, table in {"cases": finished.results.cases, **finished.results.tables}.items():
        assert set(table) <= set(COLUMNS), f"{name}: {set(table) - set(COLUMNS)}"
    assert len(finished.results.cases) == 21
    assert dict(zip(finished.results.cases.engine, finished.results.cases.status, strict=True)) == {
        "analytic": "ok", "mujoco": "ok", "pymunk": "ok", "single": "ok", "oracle": "ok", "lazy": "ok",
        "picky": "refused", "raising": "error",
    }  # fmt: skip
    stages = ["compiled kernels", "the truth", "the errors", "long runs", "the clock, one at a time"]
    assert list(log.stages) == stages


def test_errors_and_orders_are_those_of_the_methods(done):
    for method_, claimed in {"rk4": 4, "euler": 1}.items():
        engine = "analytic" if method_ == "rk4" else "mujoco"
        found = rows(done, engine=engine, method=method_)
        assert found.order_observed.to_numpy() == pytest.approx(claimed, abs=0.1)
        errors = found.sort_values("dt").error_max.to_numpy()
        assert errors[1:] / errors[:-1] == pytest.approx(2.0**claimed, rel=0.3)
    adaptive = rows(done, method="adaptive", engine="analytic")
    assert list(adaptive.tolerance) == [1e-5, 1e-8, 1e-11]
    assert (np.diff(adaptive.error_max) < 0).all()
    assert (np.diff(adaptive.steps) > 0).all()
    assert adaptive.dt.isna().all()


def test_prices_lie_between_the_steps_around_them(done):
    found = 0
    for _, price in rows(done, "prices").iterrows():
        cases = rows(done, engine=price.engine, method=price.method).sort_values(["dt", "tolerance"], ascending=False)
        if price.settings:
            cases = cases[cases.settings == price.settings]
        cases = cases[(cases.status == "ok")]
        good = np.flatnonzero(cases.error_max <= price.accuracy)
        assert np.isfinite(price.run_s) == bool(len(good))
        if not len(good):
            continue
        pair = cases.iloc[max(good[0] - 1, 0) : good[0] + 1]
        assert price.bound == (good[0] == 0)
        assert pair.run_s.min() * 0.999 <= price.run_s <= pair.run_s.max() * 1.001
        looks = pair.step_and_state_us * 1e-6 * np.where(pair.dt.isna(), 20, np.rint(0.5 / pair.dt))
        assert looks.min() * 0.999 <= price.with_states_s <= looks.max() * 1.001
        found += 1
    assert found > 10
    reached = rows(done, "prices", engine="mujoco").set_index("accuracy").run_s
    assert reached.isna().to_dict() == {1e-2: False, 1e-3: True, 1e-4: True, 1e-6: True}


def test_a_method_without_step_or_tolerance_has_a_price_too(done):
    price = rows(done, "prices", engine="lazy").set_index("accuracy").loc[1e-6]
    (its,) = rows(done, engine="lazy").run_s
    assert price.run_s == its
    assert price.bound
    assert np.isnan([price["dt"], price["tolerance"]]).all()


def test_long_runs_are_of_every_method_with_a_fixed_step(done):
    found = rows(done, "long_runs")
    ok = found[found.status == "ok"]
    assert set(ok.engine) == {"analytic", "mujoco", "pymunk", "single", "oracle"}
    assert set(ok.steps) == {1000}
    assert set(ok.dt) == {1e-3}
    euler, rk4 = (ok[ok.method == name].iloc[0] for name in ("euler", "rk4"))
    assert rk4.energy_drift_band < 1e-8 < euler.energy_drift_band
    assert (ok.energy_drift_band >= ok.energy_band_first_tenth).all()
    assert (ok.energy_drift_band >= ok.energy_band_last_tenth).all()
    assert list(found[found.status != "ok"].engine) == ["raising"]
    curves = rows(done, "curves", engine="mujoco")
    assert curves.t_s.max() == pytest.approx(1.0)
    assert curves.energy_error.abs().max() == pytest.approx(euler.energy_drift_max, rel=0.05)


def test_what_is_not_declared_a_time_is_found_again(done, study, known, tmp_path):  # noqa: ARG001
    again = run(study, tmp_path, Inline).results
    first = done[0].results
    for name, table in {"cases": first.cases, **first.tables}.items():
        other = again.cases if name == "cases" else again.tables[name]
        for column_name in table:
            if not column(column_name).is_time:
                pd.testing.assert_series_equal(table[column_name], other[column_name], check_exact=True)


def test_a_finished_study_is_not_run_again(done, study, known):  # noqa: ARG001
    log = Log()
    again = run(study, done[0].out, Idle, log=log)
    assert all(total == found > 0 for total, found in log.stages.values())
    pd.testing.assert_frame_equal(again.results.cases, done[0].results.cases, check_exact=True)  # times as well


# Results that are too good, or not good enough.


def flags_of(done, engine: str) -> list[str]:
    return sorted(set("; ".join(rows(done, engine=engine)["flags"]).split("; ")) - {""})


def timeless(flags: list[str]) -> list[str]:
    return [flag for flag in flags if not flag.startswith("noisy timing")]


def test_good_engines_have_no_flags(done):
    for engine in ("analytic", "mujoco", "pymunk"):
        assert timeless(flags_of(done, engine)) == []


def test_an_error_that_stops_falling_is_a_plateau(done):
    (flag,) = timeless(flags_of(done, "single"))
    assert flag.startswith("plateau: the error stops at ")
    (level,) = set(rows(done, engine="single").plateau)
    assert 1e-9 < level < 1e-5  # single precision


def test_one_who_knows_the_answer_is_too_good(done):
    assert timeless(flags_of(done, "oracle")) == ["too good: the truth, to the last bit"]


def test_fewer_steps_than_asked_are_too_good(done):
    assert timeless(flags_of(done, "lazy")) == ["too good: 0 steps to 10 different times"]


def test_what_could_not_be_measured_is_a_row_without_numbers(done):
    for engine, reason in (("picky", "no chain of 2"), ("raising", "no opinion")):
        (row,) = rows(done, engine=engine).to_dict("records")
        assert reason in row["reason"]
        assert math.isnan(row["error_max"])
        assert math.isnan(row["run_s"])
        assert rows(done, "prices", engine=engine).run_s.isna().all()
        assert rows(done, "prices", engine=engine).best_error.isna().all()


RUN = {"error_max": 1e-6, "reference_error": 1e-20, "too_good": ""}
ORDER = {"order_claimed": 4, "order_observed": 3.95, "plateau": math.nan}
TIMING = {"step_spread": 0.05}


@pytest.mark.parametrize(
    ("run_", "order", "timing", "flag"),
    [
        ({"error_max": 0.0}, {}, {}, "too good: no error at all"),
        ({"error_max": 5e-20}, {}, {}, "too good: as near to the reference as that is known"),
        ({"too_good": "3 steps to 60 different times"}, {}, {}, "too good: 3 steps to 60 different times"),
        ({}, {"plateau": 2e-5}, {}, "plateau: the error stops at 2.0e-05"),
        ({}, {"order_observed": 3.7}, {}, "order 3.7 where 4 is claimed"),
        ({}, {}, {"step_spread": 0.4}, "noisy timing: spread 40%"),
        ({}, {}, {"status": "timed out", "reason": "slow"}, "not timed: timed out, slow"),
    ],
)
def test_each_flag_is_raised_by_what_it_is_about_and_by_nothing_else(run_, order, timing, flag):
    assert list(of_priced_row(RUN, ORDER, TIMING)) == []
    assert list(of_priced_row({**RUN, **run_}, {**ORDER, **order}, {**TIMING, **timing})) == [flag]


class Tampering(Inline):
    """Changes what comes back from the runs of one method: no error at all at its coarsest step."""

    def run(self, jobs, *, alone=False):
        for outcome in super().run(jobs, alone=alone):
            case = outcome.job.arguments[0] if outcome.job.function.__name__ == "measure_error" else None
            if case is not None and (case.method, case.dt) == ("rk4", 1e-2):
                outcome = Outcome(outcome.job, {**outcome.value, "error_max": 0.0})  # noqa: PLW2901
            yield outcome


def test_a_zero_that_comes_back_reaches_the_row_and_the_page(tmp_path):
    rk4 = '[[engines]]\nname = "analytic"\nmethods = ["rk4"]\ndt = [1e-2, 5e-3]\n'
    finished = run(study_file(tmp_path, engines=rk4), tmp_path / "out", Tampering, report=True)
    first, second = finished.results.cases["flags"]
    assert "too good: no error at all" in first
    assert "too good" not in second
    page = (tmp_path / "out" / "report.md").read_text("utf-8")
    assert "double: analytic rk4, step 0.01 s: too good: no error at all" in page.split("## What is odd")[1]


# What `--check` compares.


def test_a_baseline_keeps_errors_energies_and_orders(done, tmp_path):
    cases = done[0].results.cases
    write_baseline(tmp_path / "b.csv", cases)
    kept = read_baseline(tmp_path / "b.csv")
    assert {"error_max", "energy_drift_max", "order_observed"} <= set(kept)
    assert not {name for name in kept if name in COLUMNS and column(name).is_time}
    assert regressions(cases, kept) == []
    chosen = (cases.method == "rk4") & (cases.engine == "analytic")
    for name, factor in {"error_max": 1.6, "energy_drift_max": 1.6}.items():
        worse = cases.assign(**{name: cases[name].where(~chosen, factor * cases[name])})
        assert len(regressions(worse, kept)) == 4, name
    for order in (3.7, 4.3, math.nan):
        worse = cases.assign(order_observed=cases.order_observed.where(~chosen, order))
        (line,) = regressions(worse, kept)
        assert line.startswith("double analytic rk4: order_observed was 3.99, is ")
    near = cases.assign(order_observed=cases.order_observed.where(~chosen, 4.1), run_s=1e9)
    assert regressions(near, kept) == []


def test_the_made_up_results_of_the_report_s_tests_have_the_columns_of_a_study(done):
    made_up, real = cost_data.results(), done[0].results
    assert set(made_up.cases) == set(real.cases)
    assert {name: set(table) for name, table in made_up.tables.items()} == {
        name: set(table) for name, table in real.tables.items()
    }
