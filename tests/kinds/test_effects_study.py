"""The kind of study `effects`: what it measures, what a wrong law would show, its report, its table of means."""

from __future__ import annotations

import dataclasses
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pendbench.base.errors import InputError
from pendbench.commands.run import run_study
from pendbench.engines import registry
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.effects_table import with_table
from pendbench.engines.protocol import Mapped
from pendbench.kinds.effects import study as effects
from pendbench.kinds.effects import work
from pendbench.kinds.effects.columns import SceneRow, _claimed
from pendbench.kinds.effects.page import facts
from pendbench.kinds.effects.plots import price_figure
from pendbench.kinds.effects.work import EffectRun, Price, compared_times, measure_effect, measure_prices, run_times
from pendbench.measures.energy import Balance
from pendbench.report.page import Report
from pendbench.report.tables import data_frame
from pendbench.scene.scene import Effects, load_scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study.case import Case
from pendbench.study.kernels import compile_kernel
from pendbench.study.plan import load_plan
from pendbench.study.results import Results
from pendbench.study.timing import Timed
from pendbench.study.truths import Compared, KeptTruth, measure_truth
from support.no_prices import fail_to_price
from support.reading import section, tables_of
from support.scenes import chain

STUDY = """
title = "Small"
kind = "effects"
scenes = ["damped_double", "rods_triple"]
priced = "damped_double"
[[engines]]
name = "analytic"
methods = ["rk4", "rattle"]
dt = [1e-3, 5e-4]
[[engines]]
name = "mujoco"
methods = ["rk4"]
dt = [1e-3, 5e-4]
[[engines]]
name = "pymunk"
methods = ["tuned"]
dt = [1e-3, 5e-4]
"""


def damped(duration: float = 1.0):
    return dataclasses.replace(load_scene("damped_double"), duration=duration)


class Forgetful(AnalyticEngine):
    """The analytic engine, which leaves out an effect without a word."""

    name = "forgetful"

    def build(self, scene, method, dt, **settings):
        return super().build(scene.without("joint_damping"), method, dt, **settings)


class Low(AnalyticEngine):
    """The analytic engine, whose means lower the order of a method."""

    name = "low"
    effects = {**AnalyticEngine.effects, "joint_damping": Mapped("badly", orders={"rk4": 1})}


@pytest.fixture
def others():
    registry.register("forgetful", Forgetful)
    registry.register("low", Low)
    yield
    del registry._registered["forgetful"], registry._registered["low"]


@pytest.fixture(scope="module")
def measured():
    """Measures a case of one second of the damped double pendulum."""
    scene, steps = damped(), (None, 3e-3, 2e-3, 1e-3, 0.0123456789)
    truth = measure_truth(scene, np.unique(np.concatenate([compared_times(scene, dt) for dt in steps])))

    def measure(engine: str, method: str, dt: float | None):
        return measure_effect(Case(scene, engine, method, dt), truth)

    return measure


def test_a_finer_step_has_a_smaller_error_and_a_better_balance(measured):
    coarse, fine = measured("analytic", "rk4", 2e-3), measured("analytic", "rk4", 1e-3)
    assert coarse.error_max / fine.error_max == pytest.approx(16, rel=0.1)
    assert coarse.balance_error / fine.balance_error == pytest.approx(16, rel=0.3)


def test_an_accurate_method_balances_to_the_floor(measured):
    found = measured("analytic", "adaptive", None)
    assert found.error_max < 1e-13
    assert found.balance_error < 5 * found.balance_floor + 1e-14


@pytest.mark.parametrize("dt", [3e-3, 0.0123456789])
def test_steps_that_do_not_divide_the_grid_are_compared_where_they_end(measured, dt):
    """Between two times at which the truth is known the error would be some 1e-3."""
    assert 1e-14 < measured("analytic", "rk4", dt).error_max < 1e-5


def test_a_step_typed_with_fewer_digits_has_the_same_error():
    """0.2804 is the error of MuJoCo's Euler at 1/60 s against another solver's solution at every step."""
    effects = Effects(gravity=9.81, joint_damping=0.05)
    scene = dataclasses.replace(chain(2, angle=[1.5, 1.0], length=1.0, duration=10.0), effects=effects)
    steps = (0.016666666666666666, 0.016666667, 0.0166667)
    truth = measure_truth(scene, np.unique(np.concatenate([compared_times(scene, dt) for dt in steps])))
    found = [measure_effect(Case(scene, "mujoco", "euler", dt), truth).error_max for dt in steps]
    np.testing.assert_allclose(found, 0.2804, atol=1e-4)


@pytest.mark.usefixtures("others")
def test_an_effect_left_out_shows_in_error_and_balance(measured):
    for dt in (2e-3, 1e-3):
        found = measured("forgetful", "rk4", dt)
        assert found.error_max > 1e-2
        assert found.balance_error > 1e-2


@pytest.mark.usefixtures("others")
def test_an_order_that_the_means_lower_is_the_one_claimed():
    assert _claimed(Case(damped(), "low", "rk4", 1e-3)) == 1
    assert _claimed(Case(damped(), "low", "gauss4", 1e-3)) == 4
    assert _claimed(Case(damped(), "analytic", "rk4", 1e-3)) == 4


def test_prices_are_of_the_medians_of_rounds_in_turn(monkeypatch):
    """Costs 2, 4, 30 over 1, 2, 3: the medians' ratio is 4 / 2, the rounds' ratios are 2, 2 and 10."""
    costs = {"bare": iter((1.0, 2.0, 3.0)), "damped": iter((2.0, 4.0, 30.0))}
    cases = {"bare": Case(damped().without("joint_damping"), "analytic", "rk4", 1e-3)}
    cases["damped"] = Case(damped(), "analytic", "rk4", 1e-3)
    asked = []

    def measure_timing(case, until):
        assert until == case.scene.duration
        label = "damped" if "joint_damping" in case.scene.terms else "bare"
        asked.append((case.engine, label))
        return Timed("ok", step_us=next(costs[label]))

    monkeypatch.setattr(work, "measure_timing", measure_timing)
    found = measure_prices(cases, "bare").prices
    assert found == {"bare": Price(2.0, 1.0, 0.0), "damped": Price(4.0, 2.0, 8.0)}
    assert asked == [("analytic", "bare"), ("analytic", "damped")] * 3


def test_a_chain_without_energy_has_no_balance():
    scene = dataclasses.replace(damped(), effects=Effects(joint_damping=0.1), angles=np.zeros(2), rates=np.zeros(2))
    found = measure_effect(Case(scene, "analytic", "rk4", 1e-3), measure_truth(scene, compared_times(scene, 1e-3)))
    assert found.error_max == 0.0
    assert np.isnan(found.balance_error)


def test_what_needs_no_truth_is_measured_without():
    found = measure_effect(Case(damped(), "analytic", "rk4", 1e-3), None)
    assert (found.status, found.reason, found.steps, found.gap_max) == ("ok", "", 1000, 0.0)
    assert np.isnan(found.error_max)
    assert found.balance_error < 1e-9
    assert found.moved_max_rad > 1.0


@pytest.mark.parametrize(("method", "status"), [("euler", "ok"), ("rk4", "warned")])
def test_a_rope_without_a_truth_shows_which_integrator_can_follow_it(method, status):
    """MuJoCo's Euler is implicit in damping. Joints as damped as these are stiff at 2 ms, and explicit RK4 explodes."""
    rope = dataclasses.replace(
        chain(50, mass=0.002, length=0.02, angle=np.full(50, np.pi / 2), duration=1.0),
        effects=Effects(gravity=9.81, joint_damping=1e-3),
    )
    found = measure_effect(Case(rope, "mujoco", method, 2e-3), None)
    assert found.status == status
    assert (found.steps == 500) == (status == "ok")
    assert (found.balance_error < 0.05) == (status == "ok")
    assert np.isnan(found.error_max)


def test_a_scene_that_the_reference_refuses_has_no_truth_and_says_why(monkeypatch):
    def refuse(*_):
        raise InputError("not this one")

    for name in ("truths.reference_within", "kernels.reference"):
        monkeypatch.setattr(f"pendbench.study.{name}", refuse)
    truth = measure_truth(chain(2), np.array([0.0, 0.1]))
    assert (truth.status, truth.reason, len(truth.t)) == ("refused", "not this one", 0)
    assert compile_kernel("reference", chain(2)).status == "refused"


# The tables and the page, of made-up results.

TRUTH = KeptTruth("ok", horizon=5.0, error=1e-20, t=np.array([0.0, 5.0]), theta=np.array([[1.0, 1.0], [1.5, 0.0]]))
KAPITZA = load_scene("kapitza")
UPRIGHT = dataclasses.replace(TRUTH, theta=KAPITZA.angles + np.array([[0.0], [0.2]]))
#: scene, engine, method, step: error, balance
ERRORS = {
    ("damped_double", "analytic", "rk4", 2e-3): (1.6e-5, 8e-6),
    ("damped_double", "analytic", "rk4", 1e-3): (1e-6, 5e-7),
    ("damped_double", "mujoco", "rk4", 1e-3): (1e-6, 5e-7),
    ("damped_double", "mujoco", "euler", 1e-3): (1e-9, 1e-9),
    ("kapitza", "analytic", "rk4", 1e-3): (3e-5, 4e-5),
    ("kapitza", "mujoco", "rk4", 1e-3): (3e-5, 2e-5),
}


def made(*, truths=None, prices=(), errors=ERRORS, refused=()):
    """Results of these errors; `refused` are further cases."""
    scenes = {"damped_double": damped(5.0), "kapitza": KAPITZA}
    runs = {
        Case(scenes[scene], *rest): EffectRun("ok", "", 100, error, 0.0, 0.3, balance, 1e-9)
        for (scene, *rest), (error, balance) in errors.items()
    }
    runs |= {Case(scenes[scene], *rest): EffectRun("refused", "no such effect") for scene, *rest in refused}
    truths = truths or {"damped_double": TRUTH, "kapitza": UPRIGHT}
    found = effects.Found(tuple(scenes.values()), truths, runs, tuple(prices))
    options = SimpleNamespace(priced="damped_double")
    return Report(Results("made", "Made up", "effects", found, options))


def price(pair, effect, step_us, ratio, spread, status="ok"):
    return effects.Priced(Case(damped(), *pair, 1e-4), effect, status, "", Price(step_us, ratio, spread))


PRICES = (
    price(("analytic", "rk4"), "bare", 2.0, 1.0, 0.0),
    price(("analytic", "rk4"), "joint_damping", 3.0, 1.5, 0.1),
    price(("mujoco", "rk4"), "bare", 10.0, 1.0, 0.0),
    price(("mujoco", "rk4"), "joint_damping", 40.0, 4.0, 1.1),
    price(("mujoco", "euler"), "bare", 5.0, 1.0, 0.0),
    price(("mujoco", "euler"), "joint_damping", 5.5, 1.1, 0.2),
)


def test_the_best_of_each_engine_has_most_scenes_then_the_smallest_error():
    """MuJoCo's Euler has a smaller error, and one scene less; a coarser step does not count."""
    best, *_ = tables_of(made(prices=PRICES).markdown())
    assert [list(row.values()) for row in best] == [
        ["analytic", "rk4", "0.001", "2", "3.0e-5", "4.0e-5", "3", "1.5\u00d7"],
        ["mujoco", "rk4", "0.001", "2", "3.0e-5", "2.0e-5", "40", "4\u00d7 ?"],
    ]


def test_the_answer_is_read_off_the_tables():
    """The errors of the best, the prices that are not noise, and how many cases were refused."""
    report = made(prices=PRICES, refused=[("kapitza", "pymunk", "tuned", 1e-3)])
    assert report.answer == (
        "At their finest steps the smallest errors are those of analytic rk4 and mujoco rk4, at most 3.0e-5 in 2 "
        "scenes. A step with one effect costs 1.1\u00d7 (mujoco euler, joint_damping) to 1.5\u00d7 (analytic rk4, "
        "joint_damping) what it costs without. 1 case of 7 was refused."
    )
    page = report.markdown()
    best, *_ = tables_of(page)
    assert {row["e max"] for row in best if row["engine"] in ("analytic", "mujoco")} == {"3.0e-5"}
    [priced] = [row for row in tables_of(section(page, "What an effect costs"))[0] if row["effect"] == "joint_damping"]
    assert priced["mujoco euler"] == "1.1\u00d7 (5.5 µs)"
    assert priced["mujoco rk4"] == "4\u00d7 ? (40 µs)"  # noise is marked, and in no sentence


def test_what_is_proved_of_a_truth_that_was_compared_with_is_said():
    said = section(made().markdown(), "Appendix: what is proved of the truth")
    assert re.search(r"`damped_double`, from its own start, is proven to \de-\d\d rad until 5 s", said)
    assert "kapitza" not in said  # it has no certificate


def test_default_flags_are_an_effect_of_their_method():
    case = Case(damped(), "mujoco", "rk4", 1e-4, (("default_flags", 1),))
    flags = effects.Priced(case, effects.DEFAULTS, "ok", "", Price(20.0, 2.0, 0.1))
    told = section(made(prices=[*PRICES, flags]).markdown(), "What an effect costs")
    *_, row = tables_of(told)[0]
    assert (row["effect"], row["mujoco rk4"], row["mujoco euler"]) == ("bare, default flags", "2\u00d7 (20 µs)", "")
    assert "With its default flags" in told
    assert "default flags" not in made(prices=PRICES).markdown()


def test_noise_is_not_stated():
    noisy = [dataclasses.replace(row, price=row.price._replace(spread=0.3 * row.price.ratio)) for row in PRICES]
    answer = made(prices=noisy).answer
    assert "What an effect costs cannot be told from this run: all prices are noisy." in answer
    assert "\u00d7" not in answer
    assert "cost" not in made().answer


def test_nothing_compared_is_said():
    assert made(errors={}, refused=[("kapitza", "pymunk", "tuned", 1e-3)]).answer == (
        "No case of this study could be compared. 1 case of 1 was refused."
    )


def test_rows_without_a_truth_keep_their_balance_and_name_it():
    truths = {"damped_double": KeptTruth("timed out", "took longer than 20 s"), "kapitza": UPRIGHT}
    without = {key: (np.nan if key[0] == "damped_double" else error, balance)
               for key, (error, balance) in ERRORS.items()}  # fmt: skip
    report = made(truths=truths, errors=without, refused=[("damped_double", "pymunk", "tuned", 1e-3)])
    table = data_frame(report.cases).set_index(["scene", "engine", "method", "dt"])
    row = table.loc["damped_double", "mujoco", "rk4", 1e-3]
    assert (row.status, row.balance_error) == ("ok", 5e-7)
    assert row.reason == "not compared, the truth is missing (timed out: took longer than 20 s)"
    assert table.loc["kapitza", "mujoco", "rk4", 1e-3].reason == ""
    assert table.loc["damped_double", "pymunk", "tuned", 1e-3].reason == "no such effect"
    page = report.markdown()
    assert page.count("damped_double: not compared, the truth is missing (timed out: took longer than 20 s)") == 1
    assert "the truth of damped_double: **timed out**: took longer than 20 s" in page


def test_a_spread_is_a_share_of_its_price_and_the_median_counts():
    """Of 0, 0, 0, 0.1 of 1.5, 0.2 of 1.1 and 1.1 of 4."""
    report = made(prices=PRICES)
    found = facts(report.results, report.tables)
    assert found.spread_median == pytest.approx((0.0 + 0.1 / 1.5) / 2)
    assert found.spread_worst == pytest.approx(1.1 / 4.0)
    assert found.priced == 3


def test_only_what_was_refused_counts_as_refused():
    report = made(refused=[("kapitza", "pymunk", "tuned", 1e-3)])
    failed = Case(KAPITZA, "pymunk", "default", 1e-3)
    report.results.found.runs[failed] = EffectRun("not finite", "an angle is not finite")
    assert facts(report.results, report.tables).refused == 1


def test_a_method_that_was_never_compared_is_not_the_best_of_its_engine():
    errors = {**ERRORS, ("damped_double", "pymunk", "tuned", 1e-3): (np.nan, 1e-7)}
    report = made(errors=errors)
    best = facts(report.results, report.tables).best
    assert [row.case.engine for row in best] == ["analytic", "mujoco"]


def test_upright_are_single_links_on_a_driven_pivot():
    report = made()
    two = dataclasses.replace(load_scene("everything"), name="two")
    assert two.n > 1
    case = Case(two, "analytic", "rk4", 1e-3)
    found = report.results.found
    runs = {**found.runs, case: EffectRun("ok", "", 100, 1e-6, 0.0, 0.3, 1e-6, 1e-9)}
    scenes, truths = (*found.scenes, two), {**found.truths, "two": TRUTH}
    results = dataclasses.replace(
        report.results, found=dataclasses.replace(found, scenes=scenes, truths=truths, runs=runs)
    )
    upright = facts(results, Report(results).tables).upright
    assert {row.case.scene.name for row in upright} == {"kapitza"}
    assert len(upright) == 2


def test_a_run_has_the_largest_of_its_numbers(monkeypatch):
    """Angles that start at 1 rad and get 0.5 rad away from there, an energy that strays by 0.3 and comes back."""
    scene, t = damped(), np.array([0.0, 0.01, 0.02, 0.03])
    theta = scene.angles + np.array([[0.0, 0.0], [0.1, -0.5], [0.2, 0.1], [0.1, 0.0]])
    run = Trajectory(t, theta, np.zeros((4, 2)), np.array([0.0, 0.3, 0.1, 0.2]), steps=3)
    balance = Balance(t, np.array([1.0, 0.4, 1.4, 1.2]), 2.0, np.array([0.0, 1e-3, 4e-3, 2e-3]), works=True)
    zeros = np.zeros((4, 2))
    compared = Compared(t, np.array([0.0, 0.004, 0.008, 0.002]), zeros[:, 0], zeros[:, 0], zeros, zeros)
    for name, value in (("run_case", run), ("energy_balance", balance), ("compare", compared)):
        monkeypatch.setattr(work, name, lambda *_, value=value: value)
    found = measure_effect(Case(scene, "mujoco", "rk4", 0.01), KeptTruth("ok", t=t))
    assert found == EffectRun("ok", "", 3, 0.008, 0.3, pytest.approx(0.5), pytest.approx(0.3), pytest.approx(4e-3))


def test_moved_is_the_farthest_of_any_angle():
    moved = dataclasses.replace(TRUTH, theta=damped().angles + np.array([[0.1, -0.4], [0.3, 0.2]]))
    assert SceneRow(damped(), moved).moved_max_rad == pytest.approx(0.4)
    [scenes] = tables_of(section(made().markdown(), "The scenes"))
    assert [row["moved by, rad"] for row in scenes][1] == "0.2"


def test_orders_are_those_of_the_errors():
    """An error of 1.6e-5 at 2 ms and 1e-6 at 1 ms: order 4. A method without two steps has none."""
    analytic, _, euler, *_ = made().tables["orders"]
    assert (analytic.case.method, analytic.order_claimed) == ("rk4", 4)
    assert analytic.order_observed == pytest.approx(4.0)
    assert (euler.case.method, euler.order_claimed) == ("euler", 1)
    assert np.isnan(euler.order_observed)


def test_an_order_is_of_errors_that_are_neither_large_nor_rounding():
    """With 0.3 at 4 ms and 1e-13 at 0.5 ms it would be 10 to 23."""
    far = {
        ("damped_double", "analytic", "rk4", 4e-3): (0.3, 0.1),
        ("damped_double", "analytic", "rk4", 5e-4): (1e-13, 0.1),
    }
    analytic, *_ = made(errors={**ERRORS, **far}).tables["orders"]
    assert analytic.order_observed == pytest.approx(4.0)


def test_an_order_below_its_claim_is_bold():
    low = {**ERRORS, ("damped_double", "analytic", "rk4", 2e-3): (8e-6, 8e-6)}  # order 3
    assert "**3.00**" in section(made(errors=low).markdown(), "Orders")
    assert "**" not in section(made().markdown(), "Orders")


def test_a_noisy_price_is_hollow():
    figure = price_figure(PRICES)
    marks = {line.get_xdata()[0]: line.get_fillstyle() for line in figure.axes[0].lines if len(line.get_xdata()) == 1}
    assert marks == {1.0: "full", 1.5: "full", 4.0: "none", 1.1: "full"}


def test_every_price_is_within_the_picture():
    rows = [price(("analytic", "rk4"), "joint_damping", 1.0, ratio, 0.0) for ratio in (0.02, 300.0)]
    low, high = price_figure(rows).axes[0].get_xlim()
    assert low < 0.02
    assert high > 300.0


# The study.


@pytest.mark.parametrize(
    ("priced", "said"), [("double", "priced is 'double'; allowed: one of its scenes"), ("", "priced is ''; allowed")]
)
def test_a_scene_that_cannot_be_priced_is_one_line(tmp_path, priced, said):
    path = tmp_path / "bad.toml"
    path.write_text(STUDY.replace('priced = "damped_double"', f'priced = "{priced}"'))
    with pytest.raises(InputError) as caught:
        run_study(path, out=tmp_path / "out")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study, and its results in `out`."""
    folder = tmp_path_factory.mktemp("effects")
    (folder / "small.toml").write_text(STUDY)
    run_study(folder / "small.toml", out=folder / "out", jobs=1)
    return folder


def test_a_price_that_cannot_be_had_is_a_row_with_the_reason(folder, tmp_path, monkeypatch):
    shutil.copytree(folder / "out", tmp_path / "out")
    monkeypatch.setattr(effects, "measure_prices", fail_to_price)
    run_study(folder / "small.toml", out=tmp_path / "out", jobs=1)
    page = (tmp_path / "out" / "report.md").read_text("utf-8").split("## What an effect costs")[1]
    assert "no clock today" in page
    assert "refused" in page  # of rattle, in the same table
    assert "prices.png" not in page


def test_the_study_runs_and_reports(folder):
    rows = pd.read_csv(folder / "out" / "cases.csv")
    assert len(rows) == 16
    refused = rows[rows.status == "refused"]
    assert set(zip(refused.engine, refused.method, refused.scene, strict=True)) == {
        ("analytic", "rattle", "damped_double"),
        ("analytic", "rattle", "rods_triple"),
    }
    assert set(refused.reason) == {
        "method 'rattle' has no joint_damping",
        "method 'rattle' has no rod_mass",
    }
    ran = rows[rows.status == "ok"]
    assert (ran.error_max < 1e-3).all()
    assert (ran.balance_error < 1e-3).all()
    report = (folder / "out" / "report.md").read_text("utf-8")
    for heading in ("The answer", "How each engine simulates each effect", "Orders", "What an effect costs"):
        assert f"\n## {heading}\n" in report
    assert "4.00" in report
    assert "**" not in report.split("## Orders")[1].split("##")[0]  # no order below its claim
    assert {plot.name for plot in (folder / "out" / "plots").iterdir()} == {"balance.png", "prices.png"}


def test_the_bundled_study_holds_every_effect_alone_and_all_together():
    from pendbench.effects import names

    plan = load_plan("effects")
    called = [set(scene.terms) - {"gravity"} for scene in plan.scenes]
    alone = {effect for own in called if len(own) == 1 for effect in own}
    assert alone == set(names()) - {"gravity", "joint_rest"}
    assert {"joint_stiffness", "joint_rest"} in called  # which is nothing by itself
    assert set(names()) - {"gravity", "armature"} in called  # which pymunk refuses


def test_the_documented_table_is_that_of_the_adapters():
    for extra in ("heyoka", "pinocchio"):
        pytest.importorskip(extra)
    page = Path(__file__).parents[2] / "docs" / "effects.md"
    assert with_table(page.read_text("utf-8")) == page.read_text("utf-8")


def test_errors_are_taken_at_whole_steps_next_to_the_grid():
    np.testing.assert_allclose(compared_times(damped(0.5), None), np.arange(51) / 100, rtol=1e-14)
    np.testing.assert_array_equal(compared_times(damped(0.05), 4e-3), np.array([0, 2, 5, 8, 10, 12]) * 4e-3)
    np.testing.assert_array_equal(compared_times(damped(0.05), 0.02), np.arange(3) * 0.02)
    np.testing.assert_array_equal(compared_times(damped(0.004), None), [0.0, 0.004])  # shorter than the grid is wide


def test_a_run_has_every_step_for_its_balance():
    np.testing.assert_array_equal(run_times(damped(0.05), 4e-3), np.arange(13) * 4e-3)
    assert set(compared_times(damped(0.5), None)) <= set(run_times(damped(0.5), None))
    assert len(run_times(damped(0.5), None)) == 20 * 50 + 1
    assert len(run_times(damped(5.0), 1e-4)) < 20_000  # of 50,000 steps
