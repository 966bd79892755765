"""Verdicts: at their limits, and of every status."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.base.faults import STATUSES
from pendbench.measures.verdict import VERDICTS, is_known, verdict_of

T = np.linspace(0.0, 1.0, 11)
NONE = np.zeros(11)


def strays(worst, at=5):
    values = NONE.copy()
    values[at] = worst
    return values


@pytest.mark.parametrize(
    ("status", "energy", "gap", "word"),
    [
        ("ok", strays(0.0099), NONE, "holds"),
        ("ok", strays(-0.011), NONE, "drifts"),
        ("ok", NONE, strays(0.011), "drifts"),
        ("ok", strays(-0.99), NONE, "drifts"),
        ("ok", strays(1.01), NONE, "breaks"),
        ("ok", strays(math.nan), NONE, "breaks"),
        ("ok", strays(math.inf), NONE, "breaks"),
        ("torn", strays(0.5), NONE, "breaks"),
        ("not finite", NONE, NONE, "breaks"),
        ("not converged", NONE, NONE, "gives up"),
        ("work limit", NONE, NONE, "gives up"),
        ("not converged", strays(2.0), NONE, "breaks"),
        ("reset", strays(2.0), NONE, "resets"),
        ("warned", strays(2.0), NONE, "breaks"),
        ("warned", strays(0.5), NONE, "warned"),
        ("ok", NONE, strays(math.nan), "breaks"),
        ("ok", NONE, strays(-5.0), "breaks"),
        ("ok", NONE, strays(-0.02), "drifts"),
        ("timed out", NONE[:0], NONE[:0], "timed out"),
    ],
)
def test_verdict(status, energy, gap, word):
    found = verdict_of(status, "why", T[: len(energy)], energy, gap)
    assert found.word == word
    assert (found.reason == "") == (word == "holds")


@pytest.mark.parametrize(
    ("worst", "floor", "word"),
    [
        (0.0, 0.009, "holds"),
        (0.0, 0.011, "not told"),
        (0.02, 0.011, "drifts"),
        (2.0, 5.0, "breaks"),
        (0.0, math.nan, "holds"),
    ],
)
def test_what_a_balance_is_known_to_is_part_of_the_verdict(worst, floor, word):
    """worst: what is astray beyond the floor."""
    assert verdict_of("ok", "", T, strays(worst), NONE, floor).word == word


def test_when_the_energy_was_lost_is_told():
    found = verdict_of("ok", "", T, np.linspace(0.0, 2.0, 11), NONE)
    assert found.broke == pytest.approx(0.6)
    assert "t = 0.6 s" in found.reason
    assert math.isnan(verdict_of("ok", "", T, NONE, NONE).broke)


def test_every_status_has_a_verdict():
    words = {verdict_of(status, "why", T, NONE, NONE).word for status in STATUSES}
    assert words <= set(VERDICTS)


@pytest.mark.parametrize("word", VERDICTS)
def test_a_run_that_the_study_stopped_says_nothing_of_its_method(word):
    assert is_known(word) == (word not in ("timed out", "out of memory"))
