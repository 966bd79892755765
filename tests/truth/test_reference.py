"""The truth against everything that could know better, and how it says what it does not know."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendbench.base.compiled import compiled
from pendbench.base.errors import InputError
from pendbench.physics import dense
from pendbench.physics.exact import single_pendulum
from pendbench.physics.extended import gravity as extended
from pendbench.physics.geometry import distance
from pendbench.scene.scene import load_scene
from pendbench.solvers.extended.extrapolation import extended_derivative
from pendbench.truth import solve
from pendbench.truth.reference import MARGIN, reference
from pendbench.truth.solve import AGREEMENT
from support.scenes import chain, random_chain

GRAVITY = 9.81
EPS = np.finfo(float).eps
SAMPLES = np.linspace(0.0, 10.0, 501)


@pytest.fixture(scope="module")
def chain10():
    """The truth of a chaotic scene."""
    return reference(load_scene("chain10"), SAMPLES)


def exact(pairs):
    """The numbers that rows of (high, low) stand for."""
    return [mpmath.mpf(float(high)) + mpmath.mpf(float(low)) for high, low in pairs]


@compiled
def derivative(system, y, dy):
    extended_derivative(system, y, dy)


def derivatives(scene):
    """dy/dt of the angle form (2 n, 2) and of the vector form (3 n, 2) at the scene's start."""
    (angles, y), (vectors, z) = extended.angle_form(scene), extended.vector_form(scene)
    dy, dz = np.empty_like(y), np.empty_like(z)
    derivative(angles, y, dy)
    derivative(vectors, z, dz)
    return dy, dz


@pytest.mark.parametrize("gravity", [9.81, None])
@pytest.mark.parametrize("n", [1, 2, 6, 15])
def test_two_forms_have_the_same_accelerations(n, gravity):
    for seed in range(5):
        dy, dz = derivatives(random_chain(n, seed, spread=4.0, gravity=gravity))
        with mpmath.workdps(50):
            ours, theirs = exact(dy[n:]), exact(dz[2 * n :])
            assert max(abs(a - b) for a, b in zip(ours, theirs, strict=True)) <= 1e-29 * max(map(abs, ours))


def test_two_forms_turn_their_rods_alike():
    """What sines and cosines change by, from what the angles do."""
    scene = random_chain(6, seed=1, spread=4.0)
    dy, dz = derivatives(scene)
    with mpmath.workdps(50):
        for angle, rate, d_sine, d_cosine in zip(
            map(float, scene.angles), exact(dy[:6]), exact(dz[:6]), exact(dz[6:12]), strict=True
        ):
            assert abs(d_sine - mpmath.cos(angle) * rate) < 1e-29
            assert abs(d_cosine + mpmath.sin(angle) * rate) < 1e-29


@pytest.mark.parametrize("rate", [0.0, 7.0], ids=["swings", "turns over"])
def test_single_pendulum_is_the_exact_one(rate):
    scene = chain(1, angle=1.5, rate=rate)
    found = reference(scene, SAMPLES)
    theta, omega = single_pendulum(scene, SAMPLES)
    assert found.horizon == 10.0
    # The closed form is in doubles, and knows its argument to 4 eps: equations.md (E27).
    late = 4 * EPS * SAMPLES[:, np.newaxis]
    assert np.all(np.abs(found.offset(theta)) < np.abs(omega) * late + 2 * EPS * (1 + np.abs(theta)))
    assert np.all(np.abs(found.omega - omega) < GRAVITY * late + 2 * EPS * (1 + np.abs(omega).max()))
    assert np.abs(found.offset(theta)[:100] / (1 + np.abs(theta[:100]))).max() < 1e-14


def test_thirty_digits_agree():
    """Taylor series of the textbook's double pendulum, in arithmetic and by a method that share nothing with ours."""
    scene, until = load_scene("double").with_start([2.0, -1.0], [1.0, -3.0]), 0.2
    found = reference(scene, [until])
    with mpmath.workdps(28):
        start = [mpmath.mpf(float(x)) for x in (*scene.angles, *scene.rates)]
        expected = mpmath.odefun(textbook_double_pendulum(scene), 0, start)(mpmath.mpf(until))
        highs = (*found.theta[0], *found.omega[0])
        lows = (*found.theta_low[0], *found.omega_low[0])
        errors = [abs(a - b) for a, b in zip(exact(zip(highs, lows, strict=True)), expected, strict=True)]
        assert max(errors) < 1e-25


#: The angles of `triple` at 2, 4, ..., 10 s by heyoka's Taylor series with 237 bits: benchmarks/reference_claims.py.
TRIPLE = """
1.833162477085025378276809977795017612542
1.256412655047201133445764105939489265583
1.280699766778861226547092519922406097351
1.152309377511532308233068461401621410924
2.090563866478227928938690879761691885613
0.871380057612605324296013425670007933724
0.634571719287658031532187177722519358230
3.976451189071683060727005045301278277644
0.297206903665819586808880787136874978799
0.619861723652614182734679746022662174340
4.606504797913578871541326934149403991595
-3.58914572300790996625433309178740709710
-1.01870546205686807655504055677396936834
0.354123621780663931414520786309725142657
-5.65824504846392688650323326285315977872
"""


def test_claim_holds_where_chaos_has_been_at_work():
    """Grown a million times and more; the difference of the two solves alone is no bound."""
    scene = load_scene("triple")
    found = reference(scene, [2.0, 4.0, 6.0, 8.0, 10.0])
    with mpmath.workdps(45):
        right = np.array([mpmath.mpf(number) for number in TRIPLE.split()]).reshape(5, 3)
        for k, angles in enumerate(right):
            pairs = zip(found.theta[k], found.theta_low[k], strict=True)
            offset = (angles - np.array(exact(pairs))).astype(float)
            error = distance(scene.lengths, found.theta[k], offset)
            assert error <= found.bound[k]
    assert error > 1e-23  # and it did grow


def textbook_double_pendulum(scene):
    m1, m2, l1, l2 = (mpmath.mpf(float(x)) for x in (*scene.masses, *scene.lengths))
    g = mpmath.mpf(scene.effects.gravity)

    def derivative(_, state):
        a1, a2, w1, w2 = state
        cos, sin = mpmath.cos_sin(a1 - a2)
        below = m1 + m2 * sin**2
        sin1, sin2 = mpmath.sin(a1), mpmath.sin(a2)
        first = -m2 * sin * (l2 * w2**2 + l1 * w1**2 * cos) - g * ((m1 + m2) * sin1 - m2 * sin2 * cos)
        second = sin * ((m1 + m2) * l1 * w1**2 + m2 * l2 * w2**2 * cos) + g * (m1 + m2) * (sin1 * cos - sin2)
        return [w1, w2, first / (l1 * below), second / (l2 * below)]

    return derivative


@pytest.mark.parametrize("name", ["double", "chain5"])
def test_scipy_and_the_dense_form_agree(name):
    scene = load_scene(name)
    n = scene.n
    solved = solve_ivp(
        lambda _, y: np.concatenate([y[n:], dense.accelerations(scene, y[:n], y[n:])]),
        (0.0, 1.0),
        np.concatenate([scene.angles, scene.rates]),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    found = reference(scene, [1.0])
    # Some hundred steps, each off by the tolerance, and what the motion has made of the first ones.
    assert np.abs(found.offset(solved.y[:n, -1:].T)).max() < 1e-10
    assert np.abs(found.omega[0] - solved.y[n:, -1]).max() < 1e-9


def test_mirror_image_moves_as_the_mirror_image():
    scene = random_chain(4, seed=2, spread=2.0)
    one, other = (reference(s, [1.0]) for s in (scene, scene.with_start(-scene.angles, -scene.rates)))
    assert one.horizon == other.horizon == 1.0
    assert np.abs(one.offset(-other.theta) - other.theta_low).max() < 1e-25


@pytest.mark.parametrize("form", ["angle", "vector"])
def test_forward_and_back_is_the_start(form):
    scene = load_scene("triple").with_start([2.0, -1.0, 0.5], [1.0, 0.0, -2.0])
    n = scene.n
    system, start = getattr(extended, f"{form}_form")(scene)
    run = solve.Solve(system, start.copy(), 14)
    for end in (2.0, 4.0):
        assert run.advance(end)
        run.state[-n:] *= -1.0
    with mpmath.workdps(50):
        assert max(abs(a - b) for a, b in zip(exact(run.state), exact(start), strict=True)) < 1e-22
    assert run.steps > 20  # it did move


def test_truth_of_a_chaotic_chain_ends_at_its_horizon(chain10):
    found, k = chain10, len(chain10.t)
    assert 4.0 < found.horizon < 6.0
    assert found.horizon == found.t[-1] == SAMPLES[k - 1]
    assert found.status == "ok"
    assert "horizon" in found.reason
    assert found.theta.shape == found.omega.shape == found.theta_low.shape == found.omega_low.shape == (k, 10)
    assert found.disagreement.max() <= AGREEMENT
    assert found.error == found.bound[-1] >= MARGIN * found.disagreement.max()
    assert np.all(np.diff(found.bound) >= 0.0)
    # From rounding to the limit in one stretch of exponential growth, so the end is where it must be.
    assert found.disagreement[: k // 4].max() < 1e-20
    assert found.disagreement[-1] > 0.1 * AGREEMENT


def test_horizon_hardly_depends_on_the_tolerance(chain10, monkeypatch):
    """A tenfold tolerance costs the time in which errors grow tenfold, a twentieth of the horizon here."""
    fine, scene = chain10, load_scene("chain10")
    monkeypatch.setattr(solve, "_TOLERANCES", (10 * solve._TOLERANCES[0],))
    coarse = reference(scene, SAMPLES)
    assert abs(fine.horizon - coarse.horizon) < 0.3
    # Before it, the two agree as well as the one that knows less says.
    k = min(len(fine.t), len(coarse.t))
    offset = coarse.offset(fine.theta[:k]) + fine.theta_low[:k]
    assert np.all(distance(scene.lengths, coarse.theta[:k], offset) <= fine.bound[:k] + coarse.bound[:k])


def test_calm_scene_is_known_to_its_end():
    found = reference(load_scene("double_calm"))
    assert (found.horizon, found.reason) == (10.0, "")
    assert found.t.shape == (1001,)
    assert found.error < 1e-22


@pytest.mark.parametrize("form", ["angle_form", "vector_form"])
def test_one_wrong_form_leaves_no_horizon(form, monkeypatch):
    right = getattr(extended, form)

    def wrong(scene):
        system, state = right(scene)
        return system._replace(gravity=system.gravity * (1 + 1e-6)), state

    monkeypatch.setattr(extended, form, wrong)
    found = reference(load_scene("double"))
    assert found.horizon <= 0.02
    assert len(found.t) <= 3


def test_offset_has_more_digits_than_the_angles():
    found = reference(load_scene("double"), [1.0, 2.0])
    np.testing.assert_array_equal(found.offset(found.theta), -found.theta_low)
    assert 0 < np.abs(found.theta_low).max() < 1e-15
    assert found.offset(found.theta[:1]).shape == (1, 2)


def test_solve_that_cannot_go_on_says_so(monkeypatch):
    monkeypatch.setattr(solve, "_MOST_STEPS", 50)
    found = reference(load_scene("chain5"), SAMPLES)
    assert 0.0 < found.horizon < 10.0
    assert "steps" in found.reason


def test_default_times_fill_the_scene():
    scene = chain(1, angle=0.3, duration=0.5)
    np.testing.assert_array_equal(reference(scene).t, np.linspace(0.0, 0.5, 1001))


def test_truth_is_at_the_very_times_that_are_asked_for():
    """However close or irregular; in between nothing is interpolated."""
    scene = load_scene("double")
    close = np.nextafter(0.3, 1.0)
    times = np.array([0.0, 1e-300, 1e-13, 2e-13, 1e-7, 0.1 + 1e-13, 1.0 / 3.0 - 1e-13, 1.0 / 3.0, 0.7, 0.7 + 1e-13])
    times = np.sort(np.append(times, [0.3, close]))
    found = reference(scene, times)
    np.testing.assert_array_equal(found.t, times)
    alone = {t: reference(scene, [t]) for t in (1e-7, close, 0.7)}
    for t, truth in alone.items():
        at = int(np.flatnonzero(times == t)[0])
        apart = (truth.theta[0] - found.theta[at]) + (truth.theta_low[0] - found.theta_low[at])
        assert np.abs(apart).max() < 1e-24
    # Two neighbouring doubles: the motion between them is the rate times what lies between.
    first, second = (int(np.flatnonzero(times == t)[0]) for t in (0.3, close))
    moved = (found.theta[second] - found.theta[first]) + (found.theta_low[second] - found.theta_low[first])
    np.testing.assert_allclose(moved, found.omega[first] * (close - 0.3), rtol=1e-8)


def test_many_times_in_a_short_scene_are_all_there():
    scene = chain(2, duration=2e-3)
    times = np.arange(2001) / 1_048_576.0
    found = reference(scene, times)
    np.testing.assert_array_equal(found.t, times)
    assert (found.horizon, found.reason) == (times[-1], "")


def test_horizon_is_found_on_the_way_to_a_far_time():
    """A far time alone is not one look at two solves that may meet there by chance."""
    found = reference(load_scene("chain5"), [0.5, 1e4])
    assert (found.horizon, len(found.t)) == (0.5, 1)
    assert "horizon" in found.reason


def test_one_number_is_one_time():
    assert reference(chain(1), 0.25).t == [0.25]


@pytest.mark.parametrize(
    "times",
    [[], [-1.0, 1.0], [0.0, 0.0], [1.0, 0.5], [0.0, np.nan], [np.inf], [[0.0, 1.0]], [[0.0], [1.0, 2.0]], "soon", [1j]],
)
def test_bad_times_are_refused(times):
    with pytest.raises(InputError, match=r"^times is not (a list of numbers|in order); allowed: "):
        reference(chain(1), times)


def test_whole_turns_change_nothing():
    """The physics does not know them; an angle of 1e6 rad would cost six digits, and the solves their tolerance."""
    scene, times = load_scene("double"), np.linspace(0.0, 1.0, 11)
    turns = np.array([159155.0, -3.0])
    plain = reference(scene, times)
    turned = reference(scene.with_start(scene.angles + 2 * np.pi * turns, scene.rates), times)
    assert turned.horizon == 1.0
    moved = turned.theta - 2 * np.pi * turns - plain.theta
    # the start itself was rounded to a double of 1e6
    assert np.abs(moved).max() < 1e-8


def test_light_and_heavy_masses_still_have_a_truth():
    """With a ratio of 1e8 the tightest tolerance cannot be met; a looser one can, and still is far below a double."""
    found = reference(chain(2, mass=[1.0, 1e8]), np.linspace(0.0, 0.05, 3))
    assert found.horizon == 0.05
    assert found.error < 1e-14
