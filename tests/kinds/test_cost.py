"""The cost study: what it measures of a case, by hand, and a small study from its file to its tables."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.engines import registry
from pendbench.engines.protocol import State
from pendbench.execution.pool import Outcome
from pendbench.kinds.cost.study import Window, times_of
from pendbench.kinds.cost.work import measure_error, measure_long_run
from pendbench.physics.energy import energy_scale
from pendbench.report.tables import data_frame
from pendbench.study import flags
from pendbench.study.baseline import read_baseline, regressions, write_baseline
from pendbench.study.case import Case
from pendbench.study.plan import load_plan
from pendbench.study.timing import Timed
from pendbench.study.truths import KeptTruth, measure_truth
from support.controls import Engine, Lazy, Oracle, Picky, Raising, Run, Single
from support.scenes import chain
from support.tiny_study import FIXED, Idle, Inline, Log, run, write_study

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


def test_cases_that_differ_in_step_or_tolerance_alone_have_the_rest_in_common(plan):
    tuned = {case.without_tolerance.without_step for case in plan.cases if case.engine == "pymunk"}
    assert {case.settings for case in tuned} == {(("iterations", 10),), (("iterations", 20),)}
    assert len({case.without_tolerance for case in plan.cases if case.method == "adaptive"}) == 1


def test_the_tolerance_is_that_of_a_method_that_chooses_its_steps(plan):
    scene = plan.scenes[0]
    assert Case(scene, "analytic", "adaptive", None, (("tolerance", 1e-5),)).tolerance == 1e-5
    default = registry.engine("analytic").methods["adaptive"].settings["tolerance"].default
    assert Case(scene, "analytic", "adaptive", None).tolerance == default
    assert math.isnan(Case(scene, "analytic", "rk4", 1e-2).tolerance)


# What is measured of a case, by hand.


class KnownRun(Run):
    """Swings as it was told to: states at steps 0, 1, 2, ... and the gaps there."""

    angles = (0.0, 0.1, 0.2, 0.1)
    rates = (0.0, 0.0, 3.0, 0.0)
    gaps = (0.0, 1e-3, 5e-3, 2e-3)

    def step(self):
        pass

    def state(self):
        at = min(self.taken, 3)
        return State(np.array([self.angles[at]]), np.array([self.rates[at]]), self.gaps[at])


class Known(Engine):
    name = "known"
    run = KnownRun


@pytest.fixture
def swing(monkeypatch):
    """A case of three steps of 0.1 s, of a pendulum of 1 m that hangs, and its truth: at rest, known to 1e-25."""
    monkeypatch.setitem(registry._registered, "known", Known)
    case = Case(chain(1, angle=0.0), "known", "rk4", 0.1)
    t = np.arange(4) * 0.1
    nothing = np.zeros((4, 1))
    return case, KeptTruth("ok", "", t[-1], 1e-25, t, nothing, nothing, nothing, np.array([0.0, 3e-26, 1e-25, 2e-26]))


def test_the_largest_of_everything_counts(swing):
    case, truth = swing
    found = measure_error(case, truth.t, truth)
    assert (found.status, found.reason, found.steps) == ("ok", "", 3)
    assert found.error_max == pytest.approx(2 * math.sin(0.1))  # the chord of 0.2 rad, over 1 m
    assert found.angle_error_max_rad == pytest.approx(0.2)
    assert found.gap_max == 5e-3  # the worst rod's, at the worst time
    assert found.reference_error == 1e-25
    # At 0.2 rad and 3 rad/s, over the range 2 m g l of the weight's energy.
    assert found.energy_drift_max == pytest.approx((0.5 * 9 + 9.81 * (1 - math.cos(0.2))) / (2 * 9.81))


def test_without_a_truth_a_run_keeps_all_but_its_error(swing):
    case, truth = swing
    whole = measure_error(case, truth.t, truth)
    short = replace(truth, t=truth.t[:3], theta=truth.theta[:3], theta_low=truth.theta_low[:3])
    for known in (None, KeptTruth("timed out", "took too long"), short):
        found = measure_error(case, truth.t, known)
        assert (found.status, found.reason) == ("ok", "")
        assert math.isnan(found.error_max)
        assert (found.steps, found.gap_max, found.energy_drift_max) == (3, 5e-3, whole.energy_drift_max)


def test_a_run_that_lost_its_energy_is_not_ok_and_has_no_error(swing, monkeypatch):
    case, truth = swing
    monkeypatch.setattr(KnownRun, "rates", (0.0, 0.0, 6.5, 0.0))  # 21.1 J of the 19.6 J there are
    found = measure_error(case, truth.t, truth)
    assert found.status == "energy lost"
    assert "at t = 0.2 s" in found.reason
    assert math.isnan(found.error_max)
    assert measure_long_run(case, 3).status == "energy lost"


def test_a_long_run_is_seen_whole_and_by_its_tenths(monkeypatch):
    """A pendulum that goes round, at rates such that its energy is 1, 2, ..., 100 and then 100 percent of the scale."""

    class Winding(KnownRun):
        def state(self):
            share = 1.0 + 0.01 * self.taken
            return State(np.zeros(1), np.full(1, math.sqrt(2 * 2 * 9.81 * share)))

    monkeypatch.setitem(registry._registered, "known", type("Winding", (Known,), {"run": Winding}))
    scene = chain(1, angle=0.0, rate=math.sqrt(2 * 2 * 9.81))
    assert energy_scale(scene) == pytest.approx(2 * 9.81)
    found = measure_long_run(Case(scene, "known", "rk4", 0.5), 99)
    assert (found.status, found.steps) == ("ok", 99)
    assert found.energy_drift_max == pytest.approx(0.99)
    assert found.energy_drift_band == pytest.approx(0.99)
    assert found.energy_drift_slope_per_s == pytest.approx(0.02)  # 0.01 in each 0.5 s
    assert found.energy_slope_share == pytest.approx(0.02 * 49.5 / 0.99)
    assert found.energy_band_first_tenth == pytest.approx(0.09)  # of ten of the hundred samples
    assert found.energy_band_last_tenth == pytest.approx(0.09)
    assert (found.t[-1], found.energy_error[-1]) == (49.5, pytest.approx(0.99))


# Times are the cases' own, to the last bit.


@pytest.fixture(scope="module")
def double(plan):
    return replace(plan.scenes[0], duration=10.0)


def cases_of(scene, *others):
    taylor, gauss = Case(scene, "analytic", "taylor", None, (("tolerance", 1e-13),)), "gauss6"
    return [taylor, *(Case(scene, "analytic", gauss, dt) for dt in (2e-3, 1e-3)), *others]


def errors_of(cases, window):
    """The errors of cases, all against one truth at the times of all of them."""
    times = {case: times_of(case, window) for case in cases}
    truth = measure_truth(cases[0].scene, np.unique(np.concatenate(list(times.values()))))
    return {case: measure_error(case, times[case], truth).error_max for case in cases}


def test_a_step_of_one_engine_changes_no_other_s_errors(double):
    """Steps typed to eight digits come within a billionth of a second of the others' times, and are other times."""
    window = Window(time=3.0, samples=60)
    typed = [Case(double, "mujoco", "rk4", dt) for dt in (1.6666667e-2, 8.3333333e-3)]
    alone, together = errors_of(cases_of(double), window), errors_of(cases_of(double, *typed), window)
    for case, right in zip(alone, (9.8e-14, 1.1e-14, 2.3e-15), strict=True):
        assert together[case] == pytest.approx(alone[case], rel=0.05, abs=0.0)
        assert alone[case] == pytest.approx(right, rel=0.2, abs=0.0), case
    coarse, fine = (together[case] for case in typed)
    written = [replace(case, dt=dt) for case, dt in zip(typed, (1 / 60, 1 / 120), strict=True)]
    exact = errors_of(written, window)
    assert [coarse, fine] == pytest.approx(list(exact.values()), rel=1e-3)
    assert math.log2(coarse / fine) == pytest.approx(4.0, abs=0.3)


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
    found = data_frame(done[0].report.tables[table])
    for name, value in wanted.items():
        found = found[found[name] == value]
    assert len(found), (table, wanted)
    return found


def test_every_case_is_a_row(done):
    cases = rows(done)
    assert set(FIXED) <= set(cases)
    assert len(cases) == 21
    assert dict(zip(cases.engine, cases.status, strict=True)) == {
        "analytic": "ok", "mujoco": "ok", "pymunk": "ok", "single": "ok", "oracle": "ok", "lazy": "ok",
        "picky": "refused", "raising": "error",
    }  # fmt: skip
    stages = ["what engines refuse", "kernels compiled", "the truth", "the errors", "long runs",
              "the clock, one at a time", "what moves"]  # fmt: skip
    assert list(done[1].stages) == stages


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
    again = run(study, tmp_path, Inline).report.tables
    for name, table in done[0].report.tables.items():
        first, other = data_frame(table), data_frame(again[name])
        for column in table.columns:
            if not column.is_time:
                pd.testing.assert_series_equal(first[column.name], other[column.name], check_exact=True)


def test_a_finished_study_is_not_run_again(done, study, known):  # noqa: ARG001
    log = Log()
    again = run(study, done[0].out, Idle, log=log).report
    assert all(total == found > 0 for total, found in log.stages.values())
    pd.testing.assert_frame_equal(data_frame(again.cases), rows(done), check_exact=True)  # times as well


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


def test_a_row_has_the_flags_of_its_run_its_method_and_its_timing():
    assert list(flags.too_good(1e-6, 1e-6, 1e-20, "")) == []
    assert list(flags.too_good(5e-20, 5e-20, 1e-20, "")) == ["too good: as near to the reference as that is known"]
    assert list(flags.of_steps(4, 3.81, math.nan)) == []
    rises = "plateau: the error stops at 1.2e-02, and is 1.8e+00 with the finest step"
    assert list(flags.of_steps(4, 4.0, 1.2e-2, 1.8)) == [rises]
    assert list(flags.of_steps(4, 3.7, 2e-5, 9e-5)) == [
        "order 3.7 where 4 is claimed",
        "plateau: the error stops at 2.0e-05",
    ]


@pytest.mark.parametrize(
    ("timing", "said"),
    [
        (Timed("ok", step_spread=0.1), []),
        (Timed("ok", step_spread=0.101), ["noisy timing: spread 10%"]),
        (Timed("timed out", "slow"), ["not timed: timed out, slow"]),
        (Timed("not timed"), []),
    ],
)
def test_a_timing_that_differs_by_more_than_a_tenth_is_noise(timing, said):
    assert list(timing.flags) == said
    assert timing.noisy == ("noisy" in "".join(said))


class Tampering(Inline):
    """Changes what comes back from the runs of one method: no error at all at its coarsest step."""

    def run(self, jobs, *, alone=False):
        for outcome in super().run(jobs, alone=alone):
            function, arguments = outcome.job.arguments[:2]
            if function is measure_error and arguments[0].dt == 1e-2:
                outcome = Outcome(outcome.job, replace(outcome.value, error_max=0.0))  # noqa: PLW2901
            yield outcome


def test_a_zero_that_comes_back_reaches_the_row_and_the_page(tmp_path):
    rk4 = '[[engines]]\nname = "analytic"\nmethods = ["rk4"]\ndt = [1e-2, 5e-3]\n'
    finished = run(study_file(tmp_path, engines=rk4), tmp_path / "out", Tampering, report=True)
    first, second = data_frame(finished.report.cases)["flags"]
    assert "too good: no error at all" in first
    assert "too good" not in second
    page = (tmp_path / "out" / "report.md").read_text("utf-8")
    assert "double: analytic rk4, step 0.01 s: too good: no error at all" in page.split("## What is odd")[1]


class Late(Inline):
    """The truth takes too long."""

    def run(self, jobs, *, alone=False):
        late = [job for job in jobs if job.arguments[0] is measure_truth]
        yield from (Outcome(job, fault=Fault("timed out", "took longer than 20 s")) for job in late)
        yield from super().run([job for job in jobs if job not in late], alone=alone)


def test_a_truth_that_timed_out_leaves_the_rows_their_energy_and_their_status(tmp_path):
    rk4 = '[[engines]]\nname = "analytic"\nmethods = ["rk4"]\ndt = [1e-2, 5e-3]\n'
    report = run(study_file(tmp_path, engines=rk4), tmp_path / "out", Late, report=True).report
    found = data_frame(report.cases)
    assert set(found.status) == {"ok"}
    assert set(found.reason) == {"not compared: the truth is not known (timed out: took longer than 20 s)"}
    assert (found.energy_drift_max > 0).all()
    assert (found.run_s > 0).all()
    assert found.error_max.isna().all()
    assert "LookupError" not in (tmp_path / "out" / "report.md").read_text("utf-8")


# What `--check` compares.


def test_a_baseline_keeps_errors_energies_and_orders(done, tmp_path):
    cases = rows(done)
    write_baseline(tmp_path / "b.csv", cases)
    kept = read_baseline(tmp_path / "b.csv")
    assert {"error_max", "energy_drift_max", "order_observed"} <= set(kept)
    clocked = {column.name for column in done[0].report.cases.columns if column.is_time}
    assert not clocked & set(kept)
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
