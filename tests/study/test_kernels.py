"""What is compiled before a study's jobs begin."""

from __future__ import annotations

from types import SimpleNamespace

from pendbench.base.errors import InputError
from pendbench.execution import limits
from pendbench.study import kernels
from pendbench.study.case import Case
from pendbench.study.kernels import Compiled, compile_engine, compile_kernel, compile_kernels
from support.oracle import Oracle
from support.scenes import chain


def test_an_engine_that_compiles_is_begun_once_for_each_of_its_methods_and_before_all_else(monkeypatch):
    monkeypatch.setattr(kernels, "engine", lambda name: SimpleNamespace(compiles=name == "newton"))
    own = [("newton", "steel", 0.1), ("newton", "steel", 0.05), ("newton", "featherstone", 0.1)]
    cases = [Case(chain(2), *each) for each in [("analytic", "rk4", 0.1), *own, ("mujoco", "rk4", 0.1)]]
    oracle = Oracle({compile_engine: lambda _: Compiled("ok")})
    compile_kernels(oracle, (), cases, truth=False)
    first, second = oracle.stages["kernels compiled"]
    assert set(*first.arguments) == {cases[1], cases[3]}  # methods share what is compiled: one after the other
    assert second.function is compile_kernel


def test_what_an_engine_compiles_does_not_count_against_the_limit_of_its_job(monkeypatch):
    left = []

    def build(*_, **settings):
        left.append((limits._left[:], settings))

    monkeypatch.setattr(kernels, "engine", lambda _: SimpleNamespace(build=build))
    with limits.processor_time(60.0):
        assert compile_engine((Case(chain(2), "newton", "steel", 0.1, (("flag", 1),)),)).status == "ok"
    [(stopped, settings)] = left
    assert 0.0 < stopped[0] < 61.0
    assert settings == {"flag": 1}


def test_an_engine_that_does_not_take_a_case_ends_no_study(monkeypatch):
    """What raises InputError in a worker does. Its other methods are begun all the same."""
    begun = []

    def build(_, method, __):
        begun.append(method)
        if method == "steel":
            raise InputError("no such thing")

    monkeypatch.setattr(kernels, "engine", lambda _: SimpleNamespace(build=build))
    cases = tuple(Case(chain(2), "newton", method, 0.1) for method in ("steel", "featherstone"))
    assert compile_engine(cases) == Compiled("refused", "no such thing")
    assert begun == ["steel", "featherstone"]
