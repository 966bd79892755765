"""The kind of study `effects`: what it measures, what a wrong law would show, its report, its table of means."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from job_functions import fail_to_price
from pendbench.engines import registry
from pendbench.engines.analytic import AnalyticEngine
from pendbench.engines.effects_table import with_table
from pendbench.engines.protocol import Mapped
from pendbench.errors import InputError
from pendbench.scene import Effects, load_scene
from pendbench.study import effects
from pendbench.study.api import run_study
from pendbench.study.case import Case
from pendbench.study.effect_work import measure_effect, measure_effect_truth, measure_prices, truth_times
from pendbench.study.plan import load_plan
from pendbench.study.store import Store

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


@pytest.fixture
def measured(tmp_path):
    """Measures a case of one second of the damped double pendulum."""
    store = Store(tmp_path)
    scene = damped()
    measure_effect_truth(scene, truth_times(scene), store, "0" * 24)

    def measure(engine: str, method: str, dt: float | None):
        return measure_effect(Case(scene, engine, method, dt), "0" * 24, store)

    return measure


def test_a_finer_step_has_a_smaller_error_and_a_better_balance(measured):
    coarse, fine = measured("analytic", "rk4", 2e-3), measured("analytic", "rk4", 1e-3)
    assert coarse["error_max"] / fine["error_max"] == pytest.approx(16, rel=0.1)
    assert coarse["balance_error"] / fine["balance_error"] == pytest.approx(16, rel=0.3)


def test_an_accurate_method_balances_to_the_floor(measured):
    found = measured("analytic", "adaptive", None)
    assert found["error_max"] < 1e-13
    assert found["balance_error"] < 5 * found["balance_floor"] + 1e-14


def test_steps_that_do_not_divide_the_grid_are_compared_where_they_meet_it(measured):
    assert measured("analytic", "rk4", 3e-3)["error_max"] < 1e-8  # at every third time; 1e-3 between them


@pytest.mark.usefixtures("others")
def test_an_effect_left_out_shows_in_error_and_balance(measured):
    for dt in (2e-3, 1e-3):
        found = measured("forgetful", "rk4", dt)
        assert found["error_max"] > 1e-2
        assert found["balance_error"] > 1e-2


@pytest.mark.usefixtures("others")
def test_an_order_that_the_means_lower_is_the_one_claimed():
    assert effects._claimed("low", "rk4", damped()) == 1
    assert effects._claimed("low", "gauss4", damped()) == 4
    assert effects._claimed("analytic", "rk4", damped()) == 4


def test_prices_are_ratios_to_the_bare_chain():
    bare = Case(damped().without("joint_damping"), "analytic", "rk4", 1e-3)
    twice = Case(dataclasses.replace(bare.scene, duration=0.9), "analytic", "rk4", 1e-3)
    found = measure_prices({"bare": bare, "same": twice}, "bare")["prices"]
    assert found["bare"]["step_price"] == 1.0
    assert found["same"]["step_us"] > 0.0
    assert found["same"]["step_price"] > 0.0


def test_steps_that_never_meet_the_grid_have_no_error_and_say_so(measured):
    found = measured("analytic", "rk4", 0.0123456789)
    assert "error_max" not in found
    assert found["reason"] == "no step ends at a multiple of 0.01 s, where errors are taken"
    assert found["balance_error"] < 1e-3


def test_a_chain_without_energy_has_no_balance(tmp_path):
    scene = dataclasses.replace(damped(), effects=Effects(joint_damping=0.1), angles=np.zeros(2), rates=np.zeros(2))
    store = Store(tmp_path)
    measure_effect_truth(scene, truth_times(scene), store, "0" * 24)
    found = measure_effect(Case(scene, "analytic", "rk4", 1e-3), "0" * 24, store)
    assert found["error_max"] == 0.0
    assert "balance_error" not in found


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
    assert {effect for own in called if len(own) == 1 for effect in own} == set(names()) - {"gravity"}
    assert set(names()) - {"gravity"} in called


def test_the_documented_table_is_that_of_the_adapters():
    for extra in ("heyoka", "pinocchio"):
        pytest.importorskip(extra)
    page = Path(__file__).parents[1] / "docs" / "effects.md"
    assert with_table(page.read_text("utf-8")) == page.read_text("utf-8")


def test_truth_times_are_multiples_of_the_grid():
    times = truth_times(damped(0.5))
    np.testing.assert_allclose(times, np.arange(51) / 100, rtol=1e-14)
