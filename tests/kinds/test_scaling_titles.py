"""What is known of a chain's motion, and what runs show beside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pendbench.engines.recording import simulate
from pendbench.kinds.scaling.work import measure_race
from pendbench.measures import known_motion
from pendbench.measures.coarse_motion import coarse_motion, largest_rise
from pendbench.measures.known_motion import TURNED, measure_known
from pendbench.measures.titles import TITLES, Shown
from pendbench.physics.energy import energy, energy_scale
from pendbench.physics.geometry import distance
from pendbench.scene.scene import Effects
from pendbench.study.case import Case
from support.scenes import chain

EVERY = 1 / 240
ROPE = chain(32, angle=0.5 * math.pi, duration=1.8, length=1 / 32, mass=1 / 32)
NAMES = tuple(title.name for title in TITLES)


@pytest.fixture(scope="module")
def known():
    return measure_known(ROPE, EVERY)


def test_a_motion_is_predicted_as_long_as_a_start_beside_it_stays_with_it(known):
    """A start turned by 1e-6 rad is 0.25 % off after 1.57 s, between two samples; by an independent method to 1e-6."""
    times = EVERY * np.arange(len(known.angles) + 1)
    run, other = (
        simulate(start, method="taylor", times=times, tolerance=1e-12)
        for start in (ROPE, ROPE.with_start(ROPE.angles + TURNED, ROPE.rates))
    )
    apart = distance(ROPE.lengths, run.theta, other.theta - run.theta)
    assert (apart < 0.0025).tolist() == [True] * len(known.angles) + [False]
    assert distance(ROPE.lengths, run.theta[:-1], known.angles - run.theta[:-1]).max() < 1e-4


def test_what_can_be_predicted_of_a_long_rope_is_known():
    """As long as a start beside it is within 1 %, 480 links would be known to 0.9 % and not to 1e-8."""
    rope = chain(480, angle=0.5 * math.pi, duration=2.5, length=1 / 480, mass=1 / 480)
    known = measure_known(rope, EVERY)
    last = len(known.angles) - 1
    assert 2.2 < last * EVERY < 2.4
    run = simulate(rope, method="adaptive", times=[last * EVERY], tolerance=1e-12)
    assert distance(rope.lengths, run.theta[-1], known.angles[last] - run.theta[-1]) < 1e-6


def test_the_swing_ends_where_the_centre_turns_back(known):
    right = coarse_motion(ROPE, known.angles[: len(known.lowest) + 1])
    bearing = np.arctan2(right.centre[:, 0], -right.centre[:, 1])
    assert bearing.argmin() == len(known.lowest) - 1
    assert (known.tip == right.tip[:-1]).all()
    assert (known.lowest == right.lowest[:-1]).all()
    assert known.samples == len(known.angles)


def test_what_never_parts_is_known_to_its_end():
    found = measure_known(chain(1, angle=1.0, duration=1.0), 0.05)
    assert len(found.angles) == 21


def test_a_chain_of_too_many_links_has_a_swing_alone(monkeypatch, known):
    """By two steps of `bdf2`, and within 0.5 % of what is known better; of a rough method nothing is."""
    monkeypatch.setattr(known_motion, "ACCURATE", 31)
    found = measure_known(ROPE, EVERY)
    assert not found.angles.size
    assert len(found.lowest) == len(known.lowest)
    assert np.abs(found.tip - known.tip).max() < 0.005
    rough = measure_known(replace(ROPE, duration=1.2), 24 * EVERY)
    assert not rough.angles.size
    assert not rough.lowest.size


def test_a_chain_that_the_method_refuses_is_not_known(monkeypatch):
    monkeypatch.setattr(known_motion, "ACCURATE", 1)
    found = measure_known(replace(chain(2), effects=Effects(gravity=9.81, joint_damping=0.1)), EVERY)
    assert (found.status, found.samples) == ("refused", 0)


def shown_by(method, dt, known, **settings):
    simulate(ROPE, method=method, dt=dt, times=[EVERY], **settings)  # compiles, which a race would count
    return measure_race(Case(ROPE, "analytic", method, dt, tuple(settings.items())), EVERY, NAMES, known).shown


@pytest.mark.parametrize("method", ["rk4", "bdf2"])
def test_runs_show_what_their_states_say(known, method):
    run = simulate(ROPE, method=method, dt=EVERY / 3, times=EVERY * np.arange(433))
    shown = shown_by(method, EVERY / 3, known)
    seen, k = round(shown.reached / EVERY) + 1, len(known.angles)
    off = distance(ROPE.lengths, known.angles, run.theta[:k] - known.angles)
    assert shown.error == pytest.approx(off[:seen].max(), rel=1e-6)
    energies = energy(ROPE, run.theta[:seen], run.omega[:seen]) / energy_scale(ROPE)
    assert shown.strays == pytest.approx(np.abs(energies - energies[0]).max(), rel=1e-6)
    assert shown.lost == pytest.approx(energies[0] - energies[-1], rel=1e-6)
    assert shown.risen == pytest.approx(largest_rise(energies), rel=1e-6)


@pytest.mark.parametrize(
    ("method", "dt", "settings", "outcomes"),
    [
        ("adaptive", None, {"tolerance": 1e-7}, ["held", "held", "held"]),
        ("bdf2", EVERY, {}, ["lost", "lost", "held"]),
        ("implicit_euler", EVERY, {}, ["lost", "lost", "lost"]),
    ],
)
def test_a_method_that_damps_moves_well_or_not_and_is_not_faithful(known, method, dt, settings, outcomes):
    shown = replace(shown_by(method, dt, known, **settings), spent=0.0)  # whatever the machine does
    assert [title.judge(shown).outcome for title in TITLES] == outcomes
    if method == "bdf2":
        assert 0.02 < shown.lost < 0.3
        assert shown.coarse.worst < 0.02


def test_without_anything_known_there_is_nothing_to_compare(known):
    del known
    case = Case(replace(ROPE, duration=0.1), "analytic", "rk4", EVERY / 2)
    shown = measure_race(case, EVERY, NAMES).shown
    assert isinstance(shown, Shown)
    assert all(map(math.isnan, (shown.error, shown.coarse.worst)))
    assert (shown.length, shown.reached) == pytest.approx((0.1, 0.1))
