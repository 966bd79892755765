"""Ctrl-C reaches whatever is at work, in whatever language, and does not crash the process.

A child says that it is about to begin what would take very long; then it gets a real SIGINT. Nothing here depends on
how soon it answers.
"""

from __future__ import annotations

import dataclasses
import pkgutil
import re
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

import pendbench as pb
from pendbench.base import compiled
from pendbench.engines.analytic import runs
from pendbench.engines.analytic.runs import FixedRun
from pendbench.engines.registry import engine
from pendbench.solvers import adaptive, outcome, taylor
from pendbench.solvers.methods import fixed_step_methods
from support.installed import installed_engines
from support.scenes import chain

CHILD = """
import signal
import sys

import numpy as np
import pendbench as pb
from pendbench.scene.scene import Effects

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background processes do without
one = np.ones(1)
plain = pb.Scene("plain", "A link", 1.0, one, one, 0.5 * one, 0.0 * one, Effects(gravity=9.81))
damped = pb.Scene("damped", "A link", 1.0, one, one, 0.5 * one, 0.0 * one, Effects(gravity=9.81, joint_damping=1e-9))

for work in sys.stdin:
    end = 1.0
    exec(work)  # compiles
    print("ready", flush=True)
    try:
        end = 1e9
        exec(work)
    except KeyboardInterrupt:
        print("caught", flush=True)
    end = 1.0
    exec(work)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    print("still works", flush=True)
"""
LONG = {
    "reference": "pb.reference(plain, [end])",
    "reference with effects": "pb.reference(damped, [end])",
    "adaptive": "pb.simulate(plain, method='adaptive', times=[end], most_steps=1e15)",
    "adaptive with effects": "pb.simulate(damped, times=[end], most_steps=1e15)",
    "taylor": "pb.simulate(plain, method='taylor', times=[end], most_steps=1e15)",
    "rk4": "pb.simulate(plain, method='rk4', dt=1e-3, times=[end])",
    "gauss4": "pb.simulate(plain, method='gauss4', dt=1e-3, times=[end])",
    "frame": "pb.simulate(plain, method='frame', dt=1e-3, times=[end])",
    "adaptive_rattle": "pb.simulate(plain, method='adaptive_rattle', dt=1e-3, times=[end])",
    "mujoco": "pb.simulate(plain, 'mujoco', 'euler', 1e-3, [end])",
    "pymunk": "pb.simulate(plain, 'pymunk', 'default', 1e-3, [end])",
    "pinocchio": "pb.simulate(plain, 'pinocchio', 'rk4', 1e-3, [end])",
    "heyoka": "pb.simulate(plain, 'heyoka', 'taylor', times=[end], most_steps=1e15)",
    "exudyn": "pb.simulate(plain, 'exudyn', 'dopri5', times=[end])",
    "exudyn with effects": "pb.simulate(damped, 'exudyn', 'dopri5', times=[end])",
    "exudyn, fixed step": "pb.simulate(damped, 'exudyn', 'rk4', 1e-3, [end])",
    "ensemble": "pb.simulate_ensemble(plain, np.full((64, 1), 0.5), times=[end], most_steps=10**15)",
    "ensemble, fixed step": "pb.simulate_ensemble(plain, [[0.5]], method='rk4', dt=1e-3, times=[min(end, 1e6)])",
    "flips": "pb.first_flips(pb.Scene('p', 'p', end, one, one, one, one, plain.effects), [[0.5]], most_steps=10**15)",
}


@pytest.fixture(scope="module")
def children(tmp_path_factory):
    """The child that does one work after the other, after those that did not come through one; and what all say."""
    with open(tmp_path_factory.mktemp("children") / "said", "w+", encoding="utf-8") as said:
        started = []
        yield started, said
        for child in started:
            child.stdin.close()
            code = child.wait()
            child.stdout.close()
            assert code == 0 or child is not started[-1]


def child_of(children):
    started, said = children
    if not started or started[-1].poll() is not None:
        line, pipe = [sys.executable, "-c", CHILD], subprocess.PIPE
        started.append(subprocess.Popen(line, stdin=pipe, stdout=pipe, stderr=said, text=True))
    return started[-1]


@pytest.mark.parametrize("work", LONG)
def test_an_interrupt_is_caught_and_what_it_stopped_can_be_begun_again(children, work):
    name = re.split("[ ,]", work)[0]
    if name in ("mujoco", "pymunk", "pinocchio", "heyoka", "exudyn") and name not in installed_engines():
        pytest.skip(f"{name} is not installed")
    child = child_of(children)
    try:
        print(LONG[work], file=child.stdin, flush=True)
        answers = [child.stdout.readline()]
        time.sleep(0.3)  # for it to be at work; if it is not yet, it is interrupted all the same
        child.send_signal(signal.SIGINT)
        answers += [child.stdout.readline() for _ in range(2)]
        assert answers == ["ready\n", "caught\n", "still works\n"], Path(children[1].name).read_text("utf-8")
    except BaseException:
        child.kill()
        raise


def test_no_kernel_that_python_calls_returns_a_named_tuple():
    """Numba makes one by calling Python, does not see that an interrupt has made the call fail, and crashes."""
    modules = [
        name
        for _, name, _ in pkgutil.walk_packages(pb.__path__, "pendbench.")
        if name.startswith(("pendbench.solvers.", "pendbench.physics."))
    ]
    found = [
        value for name in modules for value in vars(import_module(name)).values() if isinstance(value, CPUDispatcher)
    ]
    kernels = {kernel.py_func for kernel in found if not isinstance(kernel, compiled._Part)}
    assert len(kernels) > 30
    for kernel in kernels:
        returned = get_type_hints(kernel).get("return")
        assert not hasattr(returned, "_fields"), f"{kernel.__module__}.{kernel.__name__}"


def test_calls_of_an_engine_stay_short_and_add_up(monkeypatch):
    calls = []

    class Counting(FixedRun):
        def advance(self, steps):
            calls.append(steps)
            super().advance(steps)

    monkeypatch.setattr(runs, "FixedRun", Counting)
    run = pb.simulate(chain(2), method="rk4", dt=1e-3, times=[0.5, 5.0])
    assert calls == [500, 1000, 1000, 1000, 1000, 500]
    in_one = FixedRun(chain(2), fixed_step_methods()["rk4"], 1e-3)
    in_one.advance(5000)
    np.testing.assert_array_equal(run.theta[-1], in_one.state().theta)


NOT_WELL = ("error", "a call to go on did not come to its end, so where it is now is not known")


def test_a_run_that_was_interrupted_is_not_well_and_goes_no_further():
    rk4, calls = fixed_step_methods()["rk4"], []

    def interrupted(*given):
        calls.append(rk4.advance(*given))
        if len(calls) == 1:
            raise KeyboardInterrupt
        return calls[-1]

    run = FixedRun(chain(2), dataclasses.replace(rk4, advance=interrupted), 1e-3)
    with pytest.raises(KeyboardInterrupt):
        run.advance(10)
    before = run.state()
    run.advance(10)
    assert run.health() == NOT_WELL
    np.testing.assert_array_equal(run.state().theta, before.theta)


@pytest.mark.parametrize("solver", [adaptive, taylor])
def test_nor_does_one_that_chooses_its_steps(solver, monkeypatch):
    run = engine("analytic").build(chain(2), solver.__name__.rpartition(".")[2], None)
    run.advance_to(0.1)
    integrate = solver.integrate

    def interrupted(*given):
        integrate(*given)
        raise KeyboardInterrupt

    monkeypatch.setattr(solver, "integrate", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.advance_to(0.5)
    before = run.state()
    monkeypatch.undo()
    assert run.advance_to(1.0) == 0
    assert run.health() == NOT_WELL
    np.testing.assert_array_equal(run.state().theta, before.theta)


@pytest.mark.parametrize("work", ["adaptive", "taylor"])
def test_loops_return_to_python_often_and_go_on_as_if_they_had_not(work, monkeypatch):
    def run():
        return pb.simulate(chain(3, rate=3.0), method=work, times=[5.0])

    whole, calls = run(), []
    in_parts = outcome.run_in_parts

    def counted(loop, *rest):
        return in_parts(lambda *given: calls.append(1) or loop(*given), *rest)

    monkeypatch.setattr(outcome, "_WORK", 1)  # a step at a time
    for solver in (adaptive, taylor):
        monkeypatch.setattr(solver, "run_in_parts", counted)
    parts = run()
    assert len(calls) > 10
    assert parts.steps == whole.steps
    np.testing.assert_array_equal(parts.theta, whole.theta)
    np.testing.assert_array_equal(parts.omega, whole.omega)
