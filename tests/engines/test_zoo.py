"""Each broken engine of the zoo is caught by the check that is meant for it, and named; a right one is not."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from pendbench.engines.conformance import CHECKS, findings_of, model
from pendbench.engines.conformance.chains import calm
from pendbench.engines.conformance.check import FAILED, SKIPPED, Subject, findings
from support.zoo import ZOO, Beast, Rules, heavy, knowing

BY_NAME = {check.name: check for check in CHECKS}


@pytest.fixture(autouse=True)
def _same_process(monkeypatch):
    """Beasts may leave the folder and numpy's error state changed: the next test should not have that."""
    monkeypatch.chdir(Path.cwd())
    with np.errstate():
        yield


@pytest.mark.parametrize("how", ZOO)
def test_it_is_caught_and_named(how):
    make, name, cause = ZOO[how]
    found = findings(BY_NAME[name], Subject(make(), "rk4"))
    told = [each.line for each in found if not each.good]
    assert any(cause in line for line in told), told or found
    assert all(len(line.splitlines()) == 1 for line in told)


def test_there_are_more_than_thirty_kinds():
    assert len(ZOO) > 30


def test_the_beast_itself_is_right():
    """With all that it knows, so that it is what is broken in each that is caught."""
    found = findings_of(Subject(Beast(effects=knowing("joint_damping")), "rk4"))
    assert [each.line for each in found if not each.good] == []
    assert {each.check for each in found} == {check.name for check in CHECKS if not check.whole}


@pytest.mark.parametrize("how", ["gravity off by 0.1 %", "a step too few", "damping applied twice"])
def test_of_all_checks_the_first_that_fails_names_the_cause(how):
    make, name, cause = ZOO[how]
    found = findings_of(Subject(make(), "rk4"))
    bad = [each for each in found if not each.good]
    assert name in [each.check for each in bad]
    assert any(cause in each.cause for each in bad if each.check == name)
    dependent = [each for each in found if name in BY_NAME[each.check].needs]
    assert {each.status for each in dependent} <= {SKIPPED}


def test_limits_are_numbers_and_say_where_they_are_from():
    for check in CHECKS:
        assert check.asks.endswith("?")
        assert check.unit
        assert check.limit_from


@pytest.mark.parametrize(
    ("off", "tried", "right"),
    [
        (lambda _: 1e-7, 1, True),  # at once
        (lambda times: 0.1 / times**3, 6, True),  # 3e-6 with 32 times the steps
        (lambda times: 0.1 * 0.5 ** ((times - 1) / 3), 6, True),  # 8e-5, and its limit is 0
        (lambda _: 0.1, 3, False),  # another system: no number of steps will help
        (lambda times: 0.1 * 0.985 ** ((times - 1) / 3), 3, False),  # nor here: 0.086
    ],
)
def test_a_solver_that_settles_is_waited_for_and_another_system_is_not(monkeypatch, off, tried, right):
    scene, asked = calm(), []
    exact = model.accelerations(scene, scene.angles, scene.rates)

    def accelerations(its, scene, steps):  # noqa: ARG001
        asked.append(steps // 64)
        now = off(asked[-1])
        return model._Measured(exact + now * np.abs(exact).max(), now, 1e-5)

    monkeypatch.setattr(model, "_accelerations", accelerations)
    found = model._settled(None, scene, 64)
    assert asked == [1, 2, 4, 8, 16, 32][:tried]
    assert (found.off <= found.limit) == right


def rounded(run):
    """All of it in single precision."""
    run.q, run.v = (np.asarray(each, np.float32).astype(float) for each in (run.q, run.v))


def test_single_precision_that_is_declared_is_no_crime():
    engine = Beast(Rules(after_step=rounded), precision="single", effects=knowing("joint_damping"))
    found = findings_of(Subject(engine, "rk4"))
    assert [each.line for each in found if not each.good] == []


def test_single_precision_does_not_excuse_another_system():
    rules = Rules(after_step=rounded, weight=heavy)
    engine = Beast(rules, precision="single", effects=knowing())
    found = findings(BY_NAME["is the same system"], Subject(engine, "rk4"))
    assert any(each.status == FAILED and "gravity is 1.00" in each.cause for each in found), found


def test_the_working_folder_is_as_it_was():
    before = os.getcwd()
    findings(BY_NAME["leaves the process alone"], Subject(ZOO["changes the working folder"][0](), "rk4"))
    assert os.getcwd() == before
