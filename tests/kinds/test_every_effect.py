"""A damped, a driven and a heavy-rod scene through every kind of study: each gets its numbers, and none is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest

from pendbench.base.errors import InputError
from pendbench.commands.run import run_study
from pendbench.effects import Effects
from pendbench.engines.recording import simulate
from pendbench.kinds.chaos.work import measure_run
from pendbench.kinds.cost.work import measure_error, measure_long_run
from pendbench.kinds.scaling.study import chain_of
from pendbench.kinds.scaling.work import measure_race, measure_step_cost
from pendbench.kinds.stability.work import measure_stability
from pendbench.measures.lyapunov import _Clocked, lyapunov_exponent
from pendbench.measures.stiffest import stiffest
from pendbench.measures.symmetries import has_mirror_images, only_loses_energy
from pendbench.physics.exact import normal_modes
from pendbench.scene.scene import Scene, load_scene
from pendbench.study import runs
from pendbench.study.case import Case
from pendbench.study.plan import load_plan
from pendbench.study.truths import measure_truth
from support.scenes import chain

NAMES = ("damped_double", "driven_triple", "rods_triple")
WORKING = ("damped_double", "driven_triple")

STUDY = """
title = "Tiny"
scenes = ["damped_double", "driven_triple", "rods_triple"]
[[engines]]
name = "analytic"
methods = ["adaptive"]
[[engines]]
name = "analytic"
methods = ["rk4", "rattle"]
dt = [2e-2, 1e-2, 5e-3]
[[engines]]
name = "mujoco"
methods = ["rk4"]
dt = [1e-2]
"""
OF_KIND = {
    "chaos": 'kind = "chaos"\nstarts = 0\nsample = 0.1\nlyapunov_time = 1.0\n',
    "cost": 'kind = "cost"\nwindows = { damped_double = { time = 1.0, samples = 10 }, '
    "driven_triple = { time = 1.0, samples = 10 }, rods_triple = { time = 1.0, samples = 10 } }\n"
    'long_runs = { scenes = ["damped_double", "rods_triple"], steps = 1000, dt = 1e-3 }\n',
    "stability": 'kind = "stability"\nwork = 1e5\n'
    "durations = { damped_double = 0.5, driven_triple = 0.5, rods_triple = 0.5 }\n",
}


@pytest.mark.parametrize("kind", OF_KIND)
def test_study_takes_scenes_with_effects_and_refusals_are_rows(kind, tmp_path):
    (tmp_path / "tiny.toml").write_text(OF_KIND[kind] + STUDY)
    table = run_study(tmp_path / "tiny.toml", tmp_path / "out", jobs=1)
    refused = table.method == "rattle"
    assert set(table[refused].status) == {"refused"}
    assert set(table[~refused].status) == {"ok"}
    good = table[~refused]
    assert (good.energy_drift_max < 1e-3).all()
    assert set(good[good.energy_floor.notna()].scene) == set(WORKING)
    assert (good.energy_floor.dropna() < 1e-5).all()  # 3e-6 over 4 s at the coarsest step, 0.02 s
    if kind == "stability":
        assert set(good.verdict) == {"holds"}
        assert (good[good.method == "rk4"].stable_dt > 1e-2).all()
    else:
        assert (good[~(good.dt > 1e-2)].error_max < 1e-4).all()
        assert good[(good.method == "rk4") & (good.engine == "analytic")].order_observed.between(3.6, 4.4).all()
    page = (tmp_path / "out/report.md").read_text()
    assert "damped_double" in page


def scene_with(**effects):
    scene = chain(4, angle=1.0, duration=0.5)
    return dataclasses.replace(scene, effects=Effects(gravity=9.81, **effects))


EACH = {
    "damped": {"joint_damping": 0.02},
    "air": {"air_drag": {"linear": 0.2}},
    "rods": {"rod_mass": 0.5},
    "driven": {"drive_torque": {"joint": 1, "amplitude": 2.0, "angular_frequency": 6.0}},
}


@pytest.mark.parametrize("effects", EACH.values(), ids=EACH)
def test_scaling_measures_chains_with_effects(effects):
    case = Case(chain_of(scene_with(**effects), 3, 0.5), "analytic", "rk4", 2e-3)
    cost, race = measure_step_cost(case, 2e-3, 100), measure_race(case, 2e-3, ("energy",))
    assert (cost.status, race.status, race.shown.whole) == ("ok", "ok", True)
    assert cost.error_max < 1e-6
    assert max(cost.energy_drift_max, race.shown.strays) < 1e-5


def test_rods_and_air_are_divided_with_the_chain_and_joints_are_not():
    made = chain_of(scene_with(rod_mass=0.5, joint_damping=0.02, air_drag={"linear": 0.2, "quadratic": 0.1}), 16, 1.0)
    assert made.effects.rod_mass == pytest.approx(0.125)
    assert made.effects.joint_damping == 0.02
    assert (made.effects.air_drag.linear, made.effects.air_drag.quadratic) == pytest.approx((0.05, 0.025))


def test_scaling_refuses_a_number_for_each_joint(tmp_path):
    (tmp_path / "rope.toml").write_text(
        'title = "r"\nduration = 1.0\n[chain]\nn = 3\nmass = 1.0\nlength = 1.0\n[start]\nangles = 1.0\n'
        "[effects]\ngravity = 9.81\njoint_damping = [0.1, 0.2, 0.3]\n"
    )
    (tmp_path / "s.toml").write_text(
        'title = "s"\nkind = "scaling"\nscenes = ["rope.toml"]\nlinks = [2]\n'
        '[[engines]]\nname = "analytic"\nmethods = ["rk4"]\ndt = [1e-3]\n'
    )
    with pytest.raises(InputError, match=r"scene 'rope' with 1 links: .*joint_damping has 3 entries"):
        load_plan(tmp_path / "s.toml")


ENSEMBLE = """
title = "e"
kind = "ensemble"
scenes = ["damped_double"]
grid = 4
tolerance = 1e-6
sample = 3
coarse = 2
[[engines]]
name = "analytic"
methods = ["adaptive"]
tolerance = [1e-6, 1e-9]
[[engines]]
name = "mujoco"
methods = ["rk4"]
dt = [5e-3]
"""


def test_ensemble_of_damped_chains_is_run_one_after_the_other(tmp_path):
    (tmp_path / "e.toml").write_text(ENSEMBLE)
    table = run_study(tmp_path / "e.toml", tmp_path / "out", jobs=1)
    assert set(table.status) == {"ok"}
    assert (table.chains > 0).all()
    assert (table.changed.fillna(0) == 0).all()
    assert (table.energy_drift_max <= table.energy_floor.clip(lower=1e-4)).all()
    [found] = pd.read_csv(tmp_path / "out/maps.csv").to_dict("records")
    assert (found["pixels"], found["barred_flips"], found["mirror_largest_s"]) == (16, 0, 0.0)


def test_exponents_over_energies_need_an_energy_that_stays(tmp_path):
    (tmp_path / "e.toml").write_text(ENSEMBLE + "[exponents]\nbins = 2\nstarts = 1\nseconds = 1.0\n")
    with pytest.raises(InputError, match="'damped_double' calls for joint_damping; allowed: gravity alone, or"):
        load_plan(tmp_path / "e.toml")


@pytest.mark.parametrize(
    ("name", "mirrored", "loses"),
    [
        ("double", True, True),
        ("damped_double", True, True),
        ("rods_triple", True, True),
        ("sprung_chain10", True, False),
        ("kapitza", True, False),
        ("driven_triple", False, False),
    ],
)
def test_symmetries_of_scenes(name, mirrored, loses):
    scene = load_scene(name)
    assert (has_mirror_images(scene), only_loses_energy(scene)) == (mirrored, loses)


# A balance that is broken is noticed.


def without(scene: Scene, effect: str) -> Scene:
    return dataclasses.replace(scene, effects=dataclasses.replace(scene.effects, **{effect: None}))


@pytest.mark.parametrize(("name", "effect"), [("damped_double", "joint_damping"), ("kapitza", "driven_pivot")])
def test_engine_that_leaves_an_effect_out_is_noticed_by_its_energy(name, effect, monkeypatch):
    """It runs another scene than it is asked for: it keeps that one's energy, and so breaks this one's balance."""
    scene = load_scene(name)
    case, times = Case(scene, "analytic", "rk4", 1e-3), np.arange(0, 1001, 50) * 1e-3
    honest, stable = measure_run(case, scene, times, 0.5, False, None), measure_stability(case, 1.0)
    monkeypatch.setattr(
        runs, "simulate", lambda asked, *rest, **settings: simulate(without(asked, effect), *rest, **settings)
    )
    found = measure_run(case, scene, times, 0.5, False, None)
    assert found.energy.largest > 0.01
    assert found.energy.largest > 100 * honest.energy.largest
    assert (stable.verdict, measure_stability(case, 1.0).verdict) == ("holds", "drifts")


def test_energy_of_a_run_that_stops_nowhere_is_as_good_as_its_tolerance():
    scene, times = load_scene("damped_double"), np.linspace(0.0, 1.0, 11)
    truth, drifts = measure_truth(scene, times), {}
    for tolerance in (1e-3, 1e-13):
        case = Case(scene, "analytic", "adaptive", None, (("tolerance", tolerance),))
        found = measure_error(case, times, truth)
        assert found.status == "ok"
        assert np.isnan(found.energy_floor)
        drifts[tolerance] = found.energy_drift_max
    assert 1e-9 < drifts[1e-3] < 1e-2
    assert drifts[1e-13] < 1e-12
    assert np.isnan(measure_error(case, times, None).energy_drift_max)


def test_long_run_of_a_damped_scene_has_a_balance_that_does_not_drift():
    case = Case(load_scene("damped_double"), "analytic", "gauss4", 5e-3)
    found = measure_long_run(case, 10_000)
    assert found.status == "ok"
    assert found.energy_drift_max < 1e-5
    assert found.energy_floor < found.energy_drift_max


# Exponents of flows with effects.


def test_hanging_damped_pendulum_has_the_exponent_of_its_damping():
    """Small swings decay as e^(-c t / 2 m l^2), and neighbours meet again as fast."""
    scene = dataclasses.replace(chain(1, angle=1e-3), effects=Effects(gravity=9.81, joint_damping=0.8))
    found = lyapunov_exponent(scene, 20.0)
    assert found.rate == pytest.approx(-0.4, rel=0.02)
    assert not found.chaotic


def test_drives_go_on_from_interval_to_interval():
    """A motor that turns a weightless link: theta'' = A sin(w t), of which neighbours part as of free motion."""
    torque = {"joint": 1, "amplitude": 3.0, "angular_frequency": 2.0}
    scene = dataclasses.replace(chain(1, angle=0.0, gravity=None), effects=Effects(drive_torque=torque))
    found = lyapunov_exponent(scene, 20.0)
    assert not found.chaotic
    advance, y = _Clocked(scene, 0.4), np.zeros((1, 2))
    for _ in range(5):
        y, _ = advance(y, y)
    t = 2.0
    expected = [0.75 * (2 * t - np.sin(2 * t)), 1.5 * (1 - np.cos(2 * t))]
    np.testing.assert_allclose(y[0], expected, atol=1e-9)


# The fastest small oscillation.


def test_stiffest_is_that_of_the_normal_modes_where_only_weight_acts():
    scene = chain(6)
    nothing = dataclasses.replace(scene, effects=Effects(gravity=9.81, joint_damping=0.1))
    assert stiffest(nothing) == pytest.approx(normal_modes(scene)[0][-1], rel=1e-6)


def test_springs_and_rods_are_part_of_the_stiffest():
    """A rod of 2 kg on a spring of 5 N m/rad, with 1 kg at its tip: (m + M/3) l^2 w^2 = k + (m + M/2) g l."""
    scene = dataclasses.replace(chain(1), effects=Effects(gravity=9.81, rod_mass=2.0, joint_stiffness=5.0))
    assert stiffest(scene) == pytest.approx(np.sqrt((5.0 + 2.0 * 9.81) / (1.0 + 2.0 / 3.0)), rel=1e-6)
    free = dataclasses.replace(chain(2, gravity=None, rate=1.0), effects=Effects(joint_damping=0.1))
    assert np.isnan(stiffest(free))
