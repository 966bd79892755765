"""Every public name has an example in its docstring, and every example does what it says."""

from __future__ import annotations

import doctest
import inspect

import pytest

import pendbench as pb

FINDER = doctest.DocTestFinder(recurse=True)


def examples(name: str) -> list[doctest.DocTest]:
    """The examples of a public name and of its methods."""
    its = getattr(pb, name)
    found = FINDER.find(its, name, module=inspect.getmodule(its), globs={}, extraglobs=None)
    return [test for test in found if test.examples]


@pytest.mark.parametrize("name", pb.__all__)
def test_every_public_name_has_an_example(name):
    assert name in [test.name for test in examples(name)]


@pytest.mark.parametrize("name", pb.__all__)
def test_examples_do_what_they_say(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for test in examples(name):
        told: list[str] = []
        runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
        failed = runner.run(test, out=told.append).failed
        assert not failed, "".join(told)
