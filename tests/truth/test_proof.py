"""Enclosures hold what they must: exact solutions, others' solutions in 60 digits; and nothing false is proved."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("flint", reason="the extra `proof` is not installed")

import mpmath as mp
from flint import acb, acb_poly, arb, arb_mat

from pendbench.effects import Effects
from pendbench.physics import dense
from pendbench.scene.scene import Scene, load_scene
from pendbench.truth.proof import bounds, walk
from pendbench.truth.proof.enclose import effort_of, enclose
from pendbench.truth.proof.numbers import Dual, precision, variables
from pendbench.truth.proof.place import at
from pendbench.truth.proof.polynomials import Effort, near_solution
from pendbench.truth.proof.system import Momenta, Rates
from pendbench.truth.reference import reference
from support.scenes import chain, random_chain

BITS = 160
EXACT = 400  # bits of what enclosures are compared with


def inside(exact, ball):
    """Whether all of a ball, which must be a much smaller one, is in another."""
    assert exact.rad() < 1e-3 * ball.rad() or ball.rad() == 0
    return ball.contains(exact)


def theta_functions(z, tau):
    return [value.real for value in acb(z).modular_theta(tau)]


def swing(start, frequency, times):
    """A single pendulum released at rest from `start` (0 to pi), in balls: (E24), by theta functions."""
    with precision(EXACT):
        k = (arb(start) / 2).sin()
        quarter, other = acb(k * k).elliptic_k().real, acb(1 - k * k).elliptic_k().real
        tau = acb(0, other / quarter)
        _, two, three, four = theta_functions(acb(0), tau)
        for t in times:
            z = (frequency * arb(t) + quarter) / (three * three * arb.pi())
            one_z, two_z, three_z, four_z = theta_functions(z, tau)
            sn, cn = three / two * one_z / four_z, four / two * two_z / four_z
            dn = four / three * three_z / four_z
            yield 2 * arb.atan2(k * sn, dn), 2 * k * frequency * cn


@pytest.mark.parametrize("form", [Rates, Momenta])
@pytest.mark.parametrize("start", [0.3, 3.0])
def test_a_pendulum_s_elliptic_functions_are_inside(form, start):
    times = [0.0, 0.4, 1.3, 2.0]
    scene = chain(1, angle=start)
    found = enclose(scene, times, form=form, effort=effort_of(BITS))
    assert not found.reason
    with precision(EXACT):
        frequency = arb(9.81).sqrt()
    for seen, (theta, omega) in zip(found.seen[1:], list(swing(start, frequency, times))[1:], strict=True):
        with precision(EXACT):
            assert inside(theta, seen.theta[0])
            assert inside(omega, seen.omega[0])
        assert 0 < seen.theta[0].rad() < 1e-42


def test_a_driven_oscillator_s_sines_are_inside():
    """A spring and a motor, no gravity: J theta'' = -k theta + T sin(w t + phase)."""
    drive = {"joint": 1, "amplitude": 0.5, "angular_frequency": 3.0, "phase": 0.25}
    scene = Scene.chain(n=1, length=0.5, mass=2.0, angles=0.75, rates=-1.5, joint_stiffness=8.0, drive_torque=drive)
    times = [0.5, 1.0, 2.5]
    found = enclose(scene, times, effort=effort_of(BITS))
    assert not found.reason
    with precision(EXACT):
        own, w, phase = arb(4), arb(3), arb(0.25)  # J = 1/2
        size = 1 / (own * own - w * w)
        cosine = arb(0.75) - size * phase.sin()
        sine = (arb(-1.5) - size * w * phase.cos()) / own
        for seen in found.seen:
            t = arb(seen.t)
            theta = cosine * (own * t).cos() + sine * (own * t).sin() + size * (w * t + phase).sin()
            assert inside(theta, seen.theta[0])


def slope(scene, state):
    """The equations of a chain under gravity once more, in mpmath."""
    n = scene.n
    theta, omega = state[:n], state[n:]
    m, lengths = [mp.mpf(x) for x in scene.masses.tolist()], [mp.mpf(x) for x in scene.lengths.tolist()]
    g = mp.mpf(scene.effects.gravity)
    matrix, right = mp.matrix(n), mp.matrix(n, 1)
    for i in range(n):
        right[i] = -sum(m[i:]) * g * lengths[i] * mp.sin(theta[i])
        for j in range(n):
            weight = sum(m[max(i, j) :]) * lengths[i] * lengths[j]
            matrix[i, j] = weight * mp.cos(theta[i] - theta[j])
            right[i] -= weight * mp.sin(theta[i] - theta[j]) * omega[j] ** 2
    return [*omega, *mp.lu_solve(matrix, right)]


def extrapolated(scene, state, h, columns):
    """A step by extrapolating midpoint rules: Gragg's, whose error has even powers of its step."""
    table = []
    for k in range(1, columns + 1):
        steps = 2 * k
        d = h / steps
        before, now = state, [x + d * v for x, v in zip(state, slope(scene, state), strict=True)]
        for _ in range(steps - 1):
            before, now = now, [x + 2 * d * v for x, v in zip(before, slope(scene, now), strict=True)]
        row = [[(a + b + d * v) / 2 for a, b, v in zip(now, before, slope(scene, now), strict=True)]]
        for j in range(1, k):
            factor = (mp.mpf(k) / (k - j)) ** 2 - 1
            row.append([x + (x - y) / factor for x, y in zip(row[-1], table[-1][j - 1], strict=True)])
        table.append(row)
    return table[-1][-1]


@pytest.mark.parametrize("n", [2, 3])
def test_what_another_program_finds_in_60_digits_is_inside(n):
    scene, h = random_chain(n, seed=n, spread=2.0), 2.0**-5
    times = [h, 2 * h]
    found = enclose(scene, times, effort=effort_of(120))
    with mp.workdps(60):
        state = [mp.mpf(x) for x in (*scene.angles.tolist(), *scene.rates.tolist())]
        for seen in found.seen:
            state = extrapolated(scene, state, mp.mpf(h), 16)  # good to 1e-42
            with precision(EXACT):
                for value, ball in zip(state, (*seen.theta, *seen.omega), strict=True):
                    assert ball.contains(arb(mp.nstr(value, 58)).mid())
                    assert ball.rad() < 1e-29


def test_radii_are_those_of_neighbours():
    """From a box of 1e-30, against how neighbours part in the reference."""
    scene = load_scene("double")
    times, size, step = [0.5, 1.0], 1e-30, 1e-8
    with precision(192):
        system = Rates(scene)
        place = at([x + arb(0, size) for x in system.start(scene)])
        path = walk.Walk(system, place, arb(0), effort_of(192))
    balls = {}
    while path.t < times[-1]:
        balls |= {seen.t: seen.theta for seen in path.advance([t for t in times if path.t < t], times[-1])}
    truth = reference(scene, times)
    apart = np.zeros_like(truth.theta)
    for k in range(4):
        moved = np.concatenate([scene.angles, scene.rates])
        moved[k] += step
        change = moved[k] - [*scene.angles, *scene.rates][k]
        other = reference(scene.with_start(moved[:2], moved[2:]), times)
        scaled = size * (system.scale if k > 1 else 1.0) / change
        apart += np.abs(other.theta - truth.theta + (other.theta_low - truth.theta_low)) * scaled
    for k, t in enumerate(times):
        for ball, spread in zip(balls[t], apart[k], strict=True):
            assert 0.999 * spread < float(ball.rad()) < 20.0 * spread  # measured: up to 5.2


EFFECTS = {
    "gravity": 9.81,
    "joint_damping": [0.1, 0.2, 0.05],
    "joint_stiffness": [0.5, 1.0, 2.0],
    "joint_rest": 0.25,
    "joint_torque": [0.1, -0.2, 0.3],
    "air_drag": {"linear": [0.1, 0.2, 0.3]},
    "driven_pivot": {"axis": "x", "amplitude": 0.05, "angular_frequency": 7.0, "phase": 0.5},
    "drive_torque": {"joint": 2, "amplitude": 0.7, "angular_frequency": 3.0, "phase": -0.5},
    "armature": [0.01, 0.02, 0.03],
}
LINKS = {"mass": [0.8, 0.6, 0.4], "centre": [0.35, 0.15, -0.05], "inertia": [0.02, 0.01, 0.03]}


def with_effects(kind):
    own = {"links": LINKS} if kind == "links" else {"mass": [1.0, 0.5, 0.25], "rod_mass": [0.2, 0.1, 0.3]}
    return Scene.chain(length=[0.5, 0.3, 0.4], angles=[0.4, 1.1, -2.0], rates=[1.0, -2.0, 0.5], **own, **EFFECTS)


@pytest.mark.parametrize("kind", ["links", "rods"])
def test_both_forms_are_the_project_s_equations_with_every_effect(kind):
    scene, t = with_effects(kind), 0.75
    wanted = dense.accelerations(scene, scene.angles, scene.rates, t)
    with precision(100):
        rates, momenta = Rates(scene), Momenta(scene)
        found = [float(x) * rates.scale for x in rates.slope(rates.start(scene), arb(t))[3:]]
        state = momenta.start(scene)
        change = momenta.slope(state, arb(t))
        of_rates = momenta.motion(variables(state))[1]
        along = [float(sum(w.slopes[k] * change[k] for k in w.slopes)) for w in of_rates]
    np.testing.assert_allclose(found, wanted, rtol=1e-13)
    np.testing.assert_allclose(along, wanted, rtol=1e-13)


@pytest.mark.parametrize("form", [Rates, Momenta])
def test_derivatives_are_those_of_the_equations(form):
    scene = with_effects("links")
    with precision(300):
        system = form(scene)
        x, step = [ball.mid() for ball in system.start(scene)], arb(2) ** -100
        slopes = system.slope(variables(x), arb(0.5))
        plain = system.slope(x, arb(0.5))
        for k in range(6):
            moved = system.slope([value + step if i == k else value for i, value in enumerate(x)], arb(0.5))
            for exact, there, here in zip(slopes, moved, plain, strict=True):
                slope_k = exact.slopes.get(k, arb(0)) if isinstance(exact, Dual) else arb(0)
                assert abs((there - here) / step - slope_k) < 1e-20


def test_every_effect_is_enclosed_alike_by_both_forms():
    scene = with_effects("rods")
    times = [0.0625]
    first, second = (enclose(scene, times, form=form, effort=effort_of(120)) for form in (Rates, Momenta))
    assert len(first.seen) == len(second.seen) == 1
    for a, b in zip(first.seen, second.seen, strict=True):
        assert all(x.overlaps(y) for x, y in zip((*a.theta, *a.omega), (*b.theta, *b.omega), strict=True))
        assert max(float(ball.rad()) for ball in a.theta) < 1e-25


def one_step(effort, *, scene=None):
    """A path from the start of a scene, with M on most of its disc of convergence."""
    scene = scene or load_scene("double")
    with precision(effort.bits):
        system = Rates(scene)
        path = near_solution(system, system.start(scene), arb(0), 2.0**-3, effort)
    return system, path


def test_without_its_remainder_an_enclosure_would_miss_the_truth(monkeypatch):
    """What the exact solution catches: coefficients past the order are in M alone."""
    start, times = 3.0, [0.25, 0.5]
    scene, effort = chain(1, angle=start), Effort(160, 20, 128, 12)
    exact = list(swing(start, precise_root(9.81), times))

    def misses():
        found = enclose(scene, times, effort=effort)
        with precision(EXACT):
            return [not seen.theta[0].contains(theta) for seen, (theta, _) in zip(found.seen, exact, strict=True)]

    assert not any(misses())
    monkeypatch.setattr(walk, "largest_slope", lambda *given: without_size(bounds.largest_slope(*given)))
    monkeypatch.setattr(walk, "_length", lambda largest, _: largest.radius / 4)
    assert all(misses())


def precise_root(x):
    with precision(EXACT):
        return arb(x).sqrt()


def without_size(largest):
    return bounds.Largest(largest.radius, largest.size * 0, largest.boxes)


@pytest.mark.parametrize("form", [Rates, Momenta])
def test_no_slope_in_the_disc_and_the_tube_is_larger_than_said(form):
    """At points chosen by chance, on the disc's edge and the tube's, where analytic functions are largest."""
    scene, rng, radius = with_effects("links"), np.random.default_rng(1), 0.25
    with precision(effort_of(BITS).bits):
        system = form(scene)
        path = near_solution(system, [x.mid() for x in system.start(scene)], arb(0), 2.0**-3, effort_of(BITS))
    said = bounds.largest_slope(system, path, radius)
    largest = 0.0
    with precision(BITS):
        for angle, *turns in rng.uniform(0.0, 2 * np.pi, (20, 1 + 6)):
            u = acb(radius * np.cos(angle), radius * np.sin(angle)) * (1 - 1e-9)
            tube = [acb(np.cos(turn), np.sin(turn)) * bounds.TUBE for turn in turns]
            state = [acb_poly(its)(u) + z for its, z in zip(path.state, tube, strict=True)]
            found = system.slope(state, u * path.span + path.start)
            largest = max(largest, *(float((x * path.span).abs_upper()) for x in found))
    assert 0.3 * float(said.size) < largest < float(said.size)  # measured: 0.67 of it, and 0.90


def test_a_step_too_long_is_not_proved():
    effort = effort_of(BITS)
    system, path = one_step(effort)
    largest = bounds.largest_slope(system, path, 0.5)
    assert bounds.prove_step(system, path, largest, arb(0.125), effort) is not None
    for length in (0.5, 1.0, 40.0):  # the disc is the limit
        assert bounds.prove_step(system, path, largest, arb(length), effort) is None
    rough = Effort(BITS, 8, 128, 6)
    system, path = one_step(rough)
    largest = bounds.largest_slope(system, path, 0.5)
    assert bounds.prove_step(system, path, largest, arb(0.25), rough) is None  # it could leave its tube


def test_no_disc_reaches_past_a_singularity():
    """A pendulum near the top turns ever slower in complex time as well: poles of sn are at i K'."""
    system, path = one_step(effort_of(BITS))
    assert bounds.largest_slope(system, path, 0.5) is not None
    assert bounds.largest_slope(system, path, 8.0) is None


def test_a_box_too_wide_is_not_carried():
    scene = load_scene("double")
    with precision(128):
        system = Rates(scene)
        place = at([x + arb(0, 1e-3) for x in system.start(scene)])
        path = walk.Walk(system, place, arb(0), effort_of(128))
    assert list(path.advance([0.01], 1.0)) == []
    assert path.reason == walk.STUCK
    assert path.steps == 0


def test_wide_matrices_that_may_be_singular_prove_nothing():
    scene = Scene("two", "", 1.0, [1.0, 1.0], [0.5, 0.5], [0.0, 0.0], [0.0, 0.0], Effects(gravity=9.81))
    with precision(64):
        system = Rates(scene)
        wide = [acb(arb(0, 3), arb(0, 3)) for _ in range(4)]
        try:
            found = system.slope(wide, acb(0))
        except ZeroDivisionError:
            return
        assert not all(x.is_finite() for x in found)


def test_a_state_too_wide_to_be_seen_is_enclosed_again_with_more_bits(monkeypatch):
    """Its rates come of a matrix that may be singular, where angles are known too little; flint raises then."""
    scene, times, usual, asked = load_scene("double"), [0.0, 0.25], Momenta.motion, []

    def motion(self, state):
        asked.append(1)
        if len(asked) == 2:
            raise ZeroDivisionError("singular matrix in solve()")
        return usual(self, state)

    known = enclose(scene, times, form=Momenta)
    monkeypatch.setattr(Momenta, "motion", motion)
    found = enclose(scene, times, form=Momenta)
    assert not found.reason
    assert found.effort.bits > known.effort.bits
    for a, b in zip(known.seen, found.seen, strict=True):
        assert all(x.overlaps(y) for x, y in zip(a.theta + a.omega, b.theta + b.omega, strict=True))


def test_a_box_keeps_its_own_edges_until_they_are_too_alike():
    """As they are, nothing is added to it: orthogonal ones make that of `heavy_tip` 3e5 times as large."""
    from pendbench.truth.proof.place import _frame

    def framed(edges):
        turned = arb_mat([[arb(float(entry)) for entry in row] for row in edges])
        return np.array([[float(entry) for entry in row] for row in _frame(turned, [arb(1), arb(1)]).tolist()])

    edges = np.array([[1.0, 3.0], [0.0, 4.0]])
    np.testing.assert_allclose(framed(edges), [[1.0, 0.6], [0.0, 0.8]], rtol=1e-15)
    frame = framed(np.array([[1e-9, 2.0], [1.0, 1e9]]))
    np.testing.assert_allclose(frame.T @ frame, np.eye(2), atol=1e-15)
    assert abs(frame[1, 0]) == pytest.approx(1.0)  # along the longest


def test_a_frame_does_not_decide_what_is_proved():
    """Any invertible frame holds the same box, only less tightly: here a bad one."""
    from pendbench.truth.proof.place import Place, spread

    frame = arb_mat([[1, 1], [0, 1]])
    place = Place([arb(0), arb(0)], frame, [arb(1), arb(2)])
    assert [float(x) for x in spread(frame, place.radii)] == [3.0, 2.0]
    assert float(place.extent()) == 3.0
