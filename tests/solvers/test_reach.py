"""How long a Taylor series holds: the rule, term by term, and what it makes of terms that say nothing."""

from __future__ import annotations

import numpy as np
import pytest

import pendbench as pb
from pendbench.physics.exact import single_pendulum
from pendbench.solvers import taylor
from pendbench.solvers.control import Limits
from pendbench.solvers.taylor import NO_STEP, integrate, series_from
from support.kernels import called
from support.systems import Oscillator

ORDER, TOLERANCE = 12, 1e-9
ROUGH = 1e-4  # of a logarithm to base 2, over the order of a term


def reach(v, relative=0.0):
    """What the series of rates v (order + 1, d) is said to hold for."""
    orders = len(v)
    return called(taylor._reach)(v, np.log2(TOLERANCE) / orders, relative, 1.0 / np.arange(1.0, orders + 1))


def rule(v, relative=0.0):
    """The shortest of what each of the last four orders allows, in rates and in angles."""
    share = TOLERANCE ** (1.0 / len(v))
    allowed = []
    for k in range(len(v) - 4, len(v)):
        in_v, in_q = np.abs(v[k]) / (1.0 + relative * np.abs(v[0])), np.abs(v[k]) / (k + 1)
        allowed += [share / in_v.max() ** (1.0 / k), share / in_q.max() ** (1.0 / (k + 1))]
    return min(allowed)


def falling(d=3, seed=0):
    """A series whose terms fall by a tenth each, but for a factor."""
    factors = np.random.default_rng(seed).uniform(0.5, 2.0, (ORDER + 1, d))
    return factors * 0.1 ** np.arange(ORDER + 1.0)[:, None]


@pytest.mark.parametrize("relative", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_each_of_the_last_orders_limits_it(seed, relative):
    v = falling(seed=seed)
    v[0] *= 3.0
    assert reach(v, relative) == pytest.approx(rule(v, relative), rel=ROUGH)
    v[ORDER - seed % 4] *= 100.0
    assert reach(v, relative) == pytest.approx(rule(v, relative), rel=ROUGH)


def test_terms_have_to_fall():
    v = falling()
    v[: ORDER - 3] *= 1e-20
    early, late = np.abs(v[ORDER - 7 : ORDER - 3]).max(), np.abs(v[-4:]).max(axis=1).sum()
    assert reach(v) == pytest.approx(0.5 * (early / late) ** 0.25)


@pytest.mark.parametrize(("fall", "limits"), [(0.8, True), (1.2, False)])
def test_how_far_they_have_to_fall(fall, limits):
    v = falling()
    late, last = np.abs(v[-4:]).max(axis=1).sum(), slice(ORDER - 7, ORDER - 3)
    v[last] *= late * (2.0 * fall * rule(v)) ** 4 / np.abs(v[last]).max()
    assert reach(v) == pytest.approx((fall if limits else 1.0) * rule(v), rel=ROUGH)


def test_where_nothing_came_before_nothing_has_to_fall():
    v = falling()
    v[1 : ORDER - 3] = 0.0
    assert reach(v) == pytest.approx(rule(v), rel=ROUGH)


def test_what_does_not_move_holds_for_ever():
    v = np.zeros((ORDER + 1, 2))
    v[0] = 3.0
    assert reach(v) == np.inf


def test_last_orders_that_are_too_small_for_a_number_are_no_rest():
    v = np.zeros((ORDER + 1, 2))
    v[: ORDER - 4] = falling(2)[: ORDER - 4] * 1e-200
    most = (TOLERANCE ** (1.0 / (ORDER + 1))) * 2.0 ** (1074.0 / (ORDER + 1))
    assert 0.99 * most < reach(v) < 1.01 * most


@pytest.mark.parametrize("lost", [np.nan, np.inf])
@pytest.mark.parametrize("at", range(3))
def test_a_number_that_is_none_is_seen_wherever_it_is(at, lost):
    v = falling()
    v[-1, at] = lost
    assert np.isnan(reach(v))


def test_a_run_asks_for_what_its_limits_say():
    system, order = Oscillator(frequency=1.5), 9
    for relative in (0.0, 1.0):
        series = series_from(np.array([2e3]), np.array([1e3]), order)
        done = integrate(system, Limits(TOLERANCE, relative, 0.0, 10), 0.0, NO_STEP, 1e-9, series)
        assert done.h == pytest.approx(rule(series.v, relative), rel=ROUGH)


@pytest.mark.parametrize(("length", "end"), [(1e30, 1e16), (1e36, 1e19), (1e40, 1e21)])
def test_the_slowest_motions_are_followed(length, end):
    scene = pb.Scene.chain(1, length=length, mass=1.0, angles=0.7, rates=0.0, gravity=1.0, duration=1.0)
    run = pb.simulate(scene, method="taylor", times=[end], tolerance=1e-14, most_steps=20_000)
    assert run.status == "ok"
    theta, _ = single_pendulum(scene, np.array([end]))
    np.testing.assert_allclose(run.theta, theta, rtol=0, atol=1e-9)  # up to 6,000 steps of 1e-14 at worst
