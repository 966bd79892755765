"""What a run of `chaos` measures and what its starts show together, against values worked out by hand."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from pendbench.base.faults import Fault
from pendbench.kinds.chaos import work
from pendbench.kinds.chaos.causes import _alike
from pendbench.kinds.chaos.rows import CaseRow, MethodRow, SceneRow, departure
from pendbench.kinds.chaos.study import Options, starts_of
from pendbench.kinds.chaos.work import ChaosRun, KeptExponent, Neighbour, compared_times, measure_run
from pendbench.measures.divergence import Crossing
from pendbench.measures.orders import OrderFit
from pendbench.scene.scene import load_scene
from pendbench.scene.trajectory import Trajectory
from pendbench.study import runs
from pendbench.study.case import Case
from pendbench.study.models import Model
from pendbench.study.timing import UNTIMED
from pendbench.study.truths import KeptTruth, measure_truth
from support.scenes import chain

#: A pendulum of 1 m that hangs; whoever says that it swings is wrong by that angle.
SCENE = chain(1, angle=0.0, duration=10.0)
CASE = Case(SCENE, "analytic", "rk4", 0.5)
TIMES = np.arange(21) * 0.5
HORIZON = 6.0


def truth(horizon=HORIZON):
    """It hangs still, up to the horizon; how well that is known grows with time."""
    t = TIMES[np.less_equal(TIMES, horizon)]
    still = np.zeros((len(t), 1))
    return KeptTruth("ok", "", horizon, 1e-9, t, still, still, still, 1e-10 * t)


def measured(monkeypatch, angles, *, status="ok", known=True, order_time=0.5):
    """What is measured of a run that is at these angles, rad, at the first of the times."""
    theta = np.asarray(angles, dtype=float)[:, None]
    k = len(theta)
    run = Trajectory(TIMES[:k], theta, np.zeros((k, 1)), np.linspace(0.0, 0.1, k), status, "why", 100)
    monkeypatch.setattr(runs, "simulate", lambda *_, **__: run)
    return measure_run(CASE, SCENE, TIMES, order_time, True, truth() if known else None)


def chord(angle):
    return 2.0 * math.sin(0.5 * angle)


def strayed(angle):
    """Of a pendulum at rest at this angle, over the scale of 2 g l."""
    return 0.5 * (1.0 - math.cos(angle))


# One run


def test_half_is_half_of_the_horizon_for_errors_and_for_energy(monkeypatch):
    found = measured(monkeypatch, 1e-3 * TIMES)
    assert found.error_max == pytest.approx(chord(6e-3), rel=1e-12)
    assert found.error_half == pytest.approx(chord(3e-3), rel=1e-12)  # not chord(5e-3): the scene lasts 10 s
    assert found.known_half == pytest.approx(3e-10)
    assert found.energy.largest == pytest.approx(strayed(1e-2), rel=1e-9)  # energy needs no truth
    assert found.energy_half == pytest.approx(strayed(3e-3), rel=1e-9)
    assert found.angle_error_max == pytest.approx(6e-3)
    assert found.gap_max == 0.1
    assert found.curves.error[-1] != found.curves.error[-1]  # nothing is compared past the horizon
    assert found.curves.energy[-1] == pytest.approx(strayed(1e-2), rel=1e-9)


def test_what_is_largest_need_not_be_last(monkeypatch):
    angles = np.zeros(21)
    angles[[2, 8]] = 1e-2, 2e-2  # at 1 s and at 4 s
    found = measured(monkeypatch, angles)
    assert (found.error_half, found.error_max) == pytest.approx((chord(1e-2), chord(2e-2)))
    assert found.energy_half == pytest.approx(strayed(1e-2), rel=1e-9)


def test_crossings_are_between_the_samples(monkeypatch):
    found = measured(monkeypatch, 1e-4 * 10.0 ** np.arange(21) * (np.arange(21) < 3))
    assert [crossing.high for crossing in found.crossings[:1]] == [0.5 + 0.5]
    assert found.crossings[0].low == 0.5
    assert found.crossings[2] is None


def test_a_run_that_ended_early_has_left_the_truth_when_it_ended(monkeypatch):
    found = measured(monkeypatch, [0.0, 1e-9, 1e-9, 1e-9], status="not finite")
    assert found.crossings == (Crossing(2.0, 1.5, 2.0),) * 3
    assert found.error_max == pytest.approx(1e-9)


def test_a_run_that_ended_past_the_horizon_has_not_left_the_truth(monkeypatch):
    assert measured(monkeypatch, [1e-9] * 15, status="not finite").crossings == (None,) * 3


def test_a_run_that_never_began_was_not_compared(monkeypatch):
    assert measured(monkeypatch, [], status="error").crossings == ()


def test_without_a_truth_what_needs_none_is_measured(monkeypatch):
    found = measured(monkeypatch, 1e-3 * TIMES, known=False)
    assert found.energy.largest == pytest.approx(strayed(1e-2), rel=1e-9)
    assert (found.gap_max, found.steps, found.status) == (0.1, 100, "ok")
    assert math.isnan(found.error_max)
    assert math.isnan(found.energy_half)
    assert found.crossings == ()
    assert np.isnan(found.curves.error).all()


@pytest.mark.parametrize(("order_time", "angle"), [(2.0, 2e-3), (2.2, 2e-3), (1.8, 2e-3), (0.0, 0.0)])
def test_orders_are_of_errors_up_to_the_sample_that_is_nearest_to_their_time(monkeypatch, order_time, angle):
    found = measured(monkeypatch, 1e-3 * TIMES, order_time=order_time)
    assert found.order_error == pytest.approx(chord(angle))


def test_past_the_horizon_there_is_no_order(monkeypatch):
    assert math.isnan(measured(monkeypatch, 1e-3 * TIMES, order_time=6.4).order_error)


def test_a_run_that_lost_its_energy_is_not_ok(monkeypatch):
    spun = np.zeros((21, 1))
    spun[10:] = 20.0  # rad/s: 200 J/kg of motion where the scale is 2 g l = 19.6
    run = Trajectory(TIMES, np.zeros((21, 1)), spun, np.zeros(21))
    monkeypatch.setattr(runs, "simulate", lambda *_, **__: run)
    assert measure_run(CASE, SCENE, TIMES, 0.5, False, truth()).status == "energy lost"


def test_a_neighbour_of_the_upright_pendulum_leaves_it_at_its_own_rate():
    """By linear theory: 1e-10 cosh(w t), w = sqrt(g / l)."""
    upright = chain(1, angle=math.pi, duration=4.0)
    found = work.measure_neighbour(upright, measure_truth(upright, np.linspace(0.0, 4.0, 401)))
    t = np.linspace(0.0, 4.0, 401)
    slope = np.polyfit(t, np.log(1e-10 * np.cosh(math.sqrt(9.81) * t)), 1)[0]
    assert found.growth == pytest.approx(slope, rel=1e-3)
    assert math.isnan(work.measure_neighbour(upright, None).growth)


# Times


def case_of(dt, duration=2.0):
    return Case(dataclasses.replace(load_scene("double"), duration=duration), "analytic", "rk4", dt)


@pytest.mark.parametrize("dt", [None, 1e-2, 1e-3, 0.3, 0.07, 1.9, 2.0, 1 / 60, 0.01666667, 0.016667])
@pytest.mark.parametrize("sample", [0.05, 0.5, 10.0, 0.0123])
def test_times_are_whole_steps_and_end_with_the_scene(dt, sample):
    times = compared_times(case_of(dt), sample)
    assert times[0] == 0.0
    assert np.all(np.diff(times) > 0)
    assert times[-1] <= 2.0 * (1 + 1e-6)
    if dt is None:
        assert times[-1] > 2.0 - sample
        assert len(times) >= 21
    else:
        assert np.array_equal(times, np.rint(times / dt) * dt)
        assert times[-1] > 2.0 - max(dt, min(sample, 0.1)) - 1e-9
        assert np.diff(times).max() <= max(dt, 2 * min(sample, 0.1)) + 1e-9


def test_a_short_scene_is_sampled_twenty_times():
    assert compared_times(case_of(None, 1e-3), 0.01) == pytest.approx(np.linspace(0.0, 1e-3, 21))


# The starts


def test_the_perturbations_are_as_large_as_is_said_and_the_scene_s_own_start_comes_first():
    options = SimpleNamespace(starts=20_000, perturbation=0.01, seed=1)
    scene = load_scene("double")
    own, *others = starts_of(scene, options)
    assert own is scene
    changes = np.array([start.angles - scene.angles for start in others])
    assert changes.std() == pytest.approx(0.01, rel=4 / math.sqrt(2 * changes.size))  # 4 standard errors
    assert changes.mean() == pytest.approx(0.0, abs=4 * 0.01 / math.sqrt(changes.size))
    assert all(np.array_equal(start.rates, scene.rates) for start in others[:10])
    assert Options.model_fields["perturbation"].default == 0.01


def crossed(*times):
    return [None if time is None else Crossing(time, time - 0.1, time + 0.2) for time in times]


@pytest.mark.parametrize(
    ("times", "median", "last", "not_reached"),
    [
        ([], math.nan, math.nan, 0),
        ([None, None, None], math.nan, math.nan, 3),
        ([1.0], 1.0, 1.0, 0),
        ([5.0, 1.0, 2.0], 2.0, 5.0, 0),
        ([2.0, None, 1.0], 2.0, math.nan, 1),  # the third is later than both, and so is the latest
        ([4.0, 2.0, 3.0, 1.0], 2.5, 4.0, 0),
        ([1.0, None, 2.0, None], math.nan, math.nan, 2),  # between the second and one that is not known
        ([1.0, None, None], math.nan, math.nan, 2),
    ],
)
def test_what_never_got_there_is_later_than_all_that_did(times, median, last, not_reached):
    found = departure(crossed(*times))
    assert found.median == pytest.approx(median, nan_ok=True)
    assert found.last == pytest.approx(last, nan_ok=True)
    assert found.not_reached == not_reached
    known = [time for time in times if time is not None]
    assert found.first == pytest.approx(min(known, default=math.nan), nan_ok=True)


def test_the_band_is_the_widest_gap_between_samples():
    crossings = [Crossing(1.0, 0.9, 1.0), Crossing(2.0, 1.5, 2.0), None, Crossing(3.0, 2.8, 3.0)]
    assert departure(crossings).band == 0.5


SCENE_ROW = SceneRow(SCENE, [truth()], KeptExponent("ok", "", 1.0, 0.1, True), Neighbour("ok"))
METHOD_ROW = MethodRow(CASE, SCENE_ROW, Model("ok", "", 1e-12, 1e-13), 4, OrderFit(4.0, 0.1, 0.05, None), 1.0)


def row(*runs, refusal=None, scene=SCENE_ROW):
    return CaseRow(CASE, scene, METHOD_ROW, runs, refusal, UNTIMED)


@pytest.mark.parametrize(
    ("statuses", "ending"),
    [
        (["ok", "ok"], ("ok", "")),
        (["ok", "torn", "warned"], ("torn", "why 1 (start 1 of 2)")),
        (["crashed", "error"], ("error", "why 1 (start 1 of 1)")),
        (["not finite", "ok"], ("not finite", "why 0")),
    ],
)
def test_a_case_ends_as_the_worst_of_its_starts(statuses, ending):
    runs = [ChaosRun(status, "" if status == "ok" else f"why {i}") for i, status in enumerate(statuses)]
    assert (row(*runs).status, row(*runs).reason) == ending
    lost = dataclasses.replace(SCENE_ROW, truths=[KeptTruth("timed out", "took too long")])
    untold = row(*runs, scene=lost)
    assert untold.status == ending[0]  # a reference that cannot be had is no failure of the engine
    assert untold.reason.endswith("not compared, for want of a truth: took too long")


def test_a_refused_case_says_why():
    refused = row(refusal=Fault("refused", "no such effect"))
    assert (refused.status, refused.reason) == ("refused", "no such effect")
    assert refused.left.not_reached == 0


def test_starts_of_which_nothing_came_back_are_not_counted():
    runs = [ChaosRun("ok", crossings=(None, Crossing(2.0, 1, 3), None)), ChaosRun("crashed"), ChaosRun("timed out")]
    assert row(*runs).left == departure([Crossing(2.0, 1, 3)])


@pytest.mark.parametrize(
    ("model", "fit", "growth", "chaotic", "cause"),
    [
        (Model("ok", "", 2e-6, 1e-8), OrderFit(4.0, 0.1, 0.05, None), 1.0, True, "model"),
        (Model("ok", "", 2e-6, 1e-6), OrderFit(4.0, 0.1, 0.05, None), 1.0, True, "integration, amplified by chaos"),
        (Model("ok", "", 1e-9, 1e-12), OrderFit(4.0, 0.1, 0.05, None), 1.0, False, "integration"),
        (Model("error", "why"), OrderFit(math.nan, 0.1, 0.05, None), math.nan, True, "not known"),
    ],
)
def test_the_cause_is_told_from_what_was_measured(model, fit, growth, chaotic, cause):
    moving = dataclasses.replace(truth(), theta=truth().theta + np.linspace(0.0, 1.0, 13)[:, None])
    scene = SceneRow(SCENE, [moving], KeptExponent("ok", "", 1.0, 0.1, chaotic), Neighbour("ok"))
    assert MethodRow(CASE, scene, model, 4, fit, growth).cause == cause


@pytest.mark.parametrize(("farthest", "still"), [(0.0, True), (0.9e-12, True), (1.1e-12, False)])
def test_what_stays_within_rounding_of_its_start_does_not_move(farthest, still):
    moved = dataclasses.replace(truth(), theta=np.linspace(0.0, farthest, 13)[:, None])
    assert dataclasses.replace(SCENE_ROW, truths=[moved]).still == still
    assert not dataclasses.replace(SCENE_ROW, truths=[truth(0.0)]).still  # one sample tells nothing


def leaving(*times):
    """Runs that leave the truth at these times, s."""
    return [ChaosRun("ok", crossings=(None, crossing, None)) for crossing in crossed(*times)]


@pytest.mark.parametrize(
    ("times", "share", "until"),
    [
        ([3.0], 0.5, 3.0),
        ([3.0, 2.0, 8.0], 0.5, 3.0),  # of horizons of 6 s, 8 s and 10 s: 1/2, 1/4 and 4/5
        ([3.0, None, None], 1.0, 6.0),
        ([3.0, None], 1.0, 6.0),
        ([7.0], 1.0, 7.0),  # past the horizon there is no more than all of it
        ([], 0.0, math.nan),
    ],
)
def test_a_case_stays_for_the_median_of_its_starts_shares(times, share, until):
    truths = [truth(horizon) for horizon in (6.0, 8.0, 10.0)]
    found = row(*leaving(*times), scene=dataclasses.replace(SCENE_ROW, truths=truths))
    assert found.share == pytest.approx(share)
    assert found.stays_until == pytest.approx(until, nan_ok=True)


@pytest.mark.parametrize(("speed", "cost"), [(500.0, 2.0), (0.0, math.nan), (math.nan, math.nan)])
def test_a_cost_is_of_a_simulated_second(speed, cost):
    timing = dataclasses.replace(UNTIMED, simulated_s_per_s=speed)
    assert dataclasses.replace(row(), timing=timing).cost_ms == pytest.approx(cost, nan_ok=True)


@pytest.mark.parametrize(("count", "off", "alike"), [(3, 0.9e-3, True), (3, 1.1e-3, False), (2, 0.0, False)])
def test_methods_are_the_same_whose_errors_agree_to_a_thousandth_in_three_places(count, off, alike):
    one = {("double", 10.0**-k): 10.0 ** (-2 * k) for k in range(1, count + 1)}
    other = {key: error * (1.0 + off) for key, error in one.items()}
    assert _alike(one, {**other, ("elsewhere", 0.1): 1.0}) == alike
