"""Which method is run where none is named."""

from __future__ import annotations

import numpy as np
import pytest

import pendbench as pb
from pendbench.engines.analytic.choice import cheapest
from pendbench.engines.protocol import default_method
from pendbench.engines.registry import engine
from pendbench.physics.geometry import distance
from support.scenes import chain


@pytest.mark.parametrize(
    ("n", "tolerance", "expected"),
    [
        (10, 1e-9, "taylor"),
        (10, 2e-9, "adaptive"),
        (11, 1e-9, "adaptive"),
        (11, 1e-13, "taylor"),
        (100, 1e-13, "taylor"),
        (100, 2e-13, "adaptive"),
        (101, 1e-15, "adaptive"),
    ],
)
def test_the_cheapest_is_that_of_the_measurement(n, tolerance, expected):
    assert cheapest(chain(n), tolerance) == expected


def method_of(scene, **settings):
    return pb.simulate(scene, times=[0.0], **settings).maker.method


def test_the_tolerance_is_the_default_s_where_none_is_given():
    assert method_of(chain(100)) == "taylor"
    assert method_of(chain(100), tolerance=None) == "taylor"
    assert method_of(chain(10), tolerance=1e-6) == "adaptive"
    assert method_of(chain(10), method="adaptive") == "adaptive"


def test_what_taylor_does_not_know_is_run_by_the_other():
    assert method_of("damped_double") == method_of("kapitza") == method_of("rods_triple") == "adaptive"
    assert method_of(pb.load_scene("double").with_(gravity=None)) == "taylor"


@pytest.mark.parametrize("tolerance", ["small", -1.0, float("nan"), True])
def test_a_tolerance_that_is_none_is_still_one_line(tolerance):
    with pytest.raises(pb.InputError, match=r"tolerance is .*; allowed: a number from 1e-15 to 0\.01"):
        pb.simulate("double", tolerance=tolerance)


def test_another_engine_has_its_first_method():
    mujoco = engine("mujoco")
    assert default_method(mujoco, chain(2), {}) == next(iter(mujoco.methods))


@pytest.mark.parametrize("name", ["double", "chain5", "chain10"])
def test_a_run_is_as_good_as_the_other_method_s(name):
    """To rounding, which both let grow: over a second, some 1e-14 of the length."""
    scene, times = pb.load_scene(name), np.linspace(0.0, 1.0, 11)
    run, other = (pb.simulate(scene, method=method, times=times) for method in (None, "adaptive"))
    assert run.maker.method == "taylor"
    assert distance(scene.lengths, other.theta, run.theta - other.theta).max() < 1e-12
