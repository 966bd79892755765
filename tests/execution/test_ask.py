"""Questions in a worker process: an answer or a fault, and the program goes on."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pendbench.base.errors import InputError
from pendbench.base.faults import Fault
from pendbench.execution import ask as module
from pendbench.execution.ask import ask, ask_each
from support import job_functions as does


@pytest.fixture(autouse=True)
def _workers_find_the_functions(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]), prepend=os.pathsep)


def test_an_answer_is_what_the_function_returns_in_another_process():
    assert ask(does.identity, {"a": 1}) == {"a": 1}
    assert ask(os.getpid) != os.getpid()
    assert ask(does.identity, None) is None


def test_who_crashes_hangs_or_raises_keeps_nobody_from_answering(monkeypatch):
    monkeypatch.setattr(module, "_HANGS_S", 8.0)
    monkeypatch.setattr(module, "ANSWER_S", 0.5)
    calls = [
        (does.kill_itself,),
        (does.identity, 1),
        (does.sleep, 3600.0),
        (does.fail,),
        (does.spin,),
        (does.identity, 2),
    ]
    assert ask_each(does.call, calls) == [
        Fault("crashed", "the process died of SIGKILL"),
        1,
        Fault("timed out", "took longer than 8 s by the clock"),
        Fault("error", "ValueError: first line"),
        Fault("timed out", "took longer than 0.5 s of processor time"),
        2,
    ]


def test_bad_input_is_bad_input_and_nothing_is_nothing():
    with pytest.raises(InputError, match=r"^dt is 0; allowed: above 0$"):
        ask(does.refuse)
    assert ask_each(does.identity, []) == []
