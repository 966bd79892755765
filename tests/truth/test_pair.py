"""How two solves become a horizon and a claim: with solves whose states are given, everything by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pendbench.effects import Effects
from pendbench.truth import solve
from pendbench.truth.reference import MARGIN, reference
from support.scenes import chain

#: Two links of 1 m that hang. An effect, so that the two solves are compared by their angles.
SCENE = dataclasses.replace(chain(2, angle=0.0, length=1.0), effects=Effects(gravity=9.81, joint_damping=0.1))


class Given:
    """A solve that is at these angles, rad, at one time asked for after the other."""

    def __init__(self, angles):
        self._angles = iter(angles)
        self.state, self.t, self.h, self.allowed, self.steps = np.zeros((4, 2)), 0.0, 1e9, 0.0, 0

    def advance(self, end):
        self.state = np.zeros((4, 2))
        self.state[:2, 0] = next(self._angles)
        self.t = end
        return True


def truth(monkeypatch, *apart):
    """The reference at 1 s, 2 s, ... whose second solve is so far from the first, rad, (2,) at each."""
    hanging = Given([(0.0, 0.0)] * len(apart))
    monkeypatch.setattr(solve, "_solves_with_effects", lambda _: (hanging, Given(apart)))
    return reference(SCENE, 1.0 + np.arange(len(apart)))


@pytest.mark.parametrize("apart", [(0.0, 1.0), (1.0, -1.0)])
def test_solves_are_as_far_apart_as_the_mass_that_is_farthest(monkeypatch, apart):
    """Off by d, an angle moves a mass by d metres of 2: the outer one alone, or the inner one and hardly the outer."""
    below = truth(monkeypatch, 1.8e-9 * np.array(apart))  # the angles differ by more than 1e-9, the places do not
    assert (below.horizon, below.reason) == (1.0, "")
    assert below.disagreement == pytest.approx([0.9e-9], rel=1e-6)
    above = truth(monkeypatch, (0.0, 0.0), 2.2e-9 * np.array(apart))
    assert above.horizon == 1.0
    assert "horizon" in above.reason


def test_claim_is_of_the_largest_difference_so_far(monkeypatch):
    """Where the two meet again by chance, the claim stays: 100 times what it was."""
    found = truth(monkeypatch, (0.0, 2e-12), (0.0, 1e-9), (0.0, 4e-14))
    assert found.disagreement == pytest.approx([1e-12, 5e-10, 2e-14])
    assert MARGIN == 100.0
    assert found.bound == pytest.approx([1e-10, 5e-8, 5e-8])
    assert found.error == found.bound[-1]


def test_claim_has_what_the_steps_may_have_been_off_by(monkeypatch):
    first, second = Given([(0.0, 0.0)]), Given([(0.0, 2e-12)])
    first.allowed = 3e-11
    monkeypatch.setattr(solve, "_solves_with_effects", lambda _: (first, second))
    assert reference(SCENE, [1.0]).error == pytest.approx(1.3e-10)


def test_a_difference_that_is_not_finite_ends_it(monkeypatch):
    found = truth(monkeypatch, (0.0, math.nan))
    assert (found.horizon, len(found.t), found.error) == (0.0, 0, 0.0)
