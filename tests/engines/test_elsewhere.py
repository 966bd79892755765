"""Engines of another environment: the same runs, bit for bit, and one line for whatever is no such Python."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import pendbench as pb
from pendbench.base.errors import InputError, MissingEngineError
from pendbench.engines import elsewhere
from pendbench.engines.elsewhere import Elsewhere, _Process, use
from pendbench.engines.fingerprint import fingerprint
from pendbench.engines.protocol import mapped_effects
from pendbench.engines.registry import PYTHONS, engine, engine_names, python_of


@pytest.fixture(autouse=True)
def nowhere(monkeypatch):
    """Nothing is said of other environments."""
    monkeypatch.delenv(PYTHONS, raising=False)


@pytest.fixture
def there(monkeypatch):
    """The Python that runs the tests, as if it were another one."""
    monkeypatch.setenv(PYTHONS, json.dumps({}))
    elsewhere.stand_in.cache_clear()
    yield [f"{name}={sys.executable}" for name in ("pymunk", "scipy")]
    elsewhere.stand_in.cache_clear()


@pytest.mark.parametrize(("name", "method", "dt"), [("pymunk", "tuned", 0.01), ("scipy", "rk45", None)])
def test_a_run_in_another_environment_is_the_same_to_the_last_bit(there, name, method, dt):
    times = np.arange(5) * 0.1
    here, its = pb.simulate("double", name, method, dt, times), engine(name)
    about = its.methods, mapped_effects(its), its.version(), fingerprint(name)
    use(there, engine_names())
    other = engine(name)
    assert isinstance(other, Elsewhere)
    run = pb.simulate("double", name, method, dt, times)
    assert np.array_equal(run.theta, here.theta)
    assert run.steps == here.steps
    assert (dict(other.methods), dict(other.effects), other.version(), fingerprint(name)) == about


def test_what_an_engine_refuses_or_raises_there_is_told_here(there):
    use(there, engine_names())
    rods = pb.load_scene("rods_triple")
    refused = pb.simulate(rods, "pymunk", "tuned", 0.01, [0.0, 0.1])
    assert refused.status in ("ok", "refused")
    process = _Process("pymunk", sys.executable)
    with pytest.raises(RuntimeError, match="KeyError"):
        process.ask("state", 5)
    assert process.ask("describe")["version"]


def test_a_process_that_dies_is_an_error_of_its_run_and_the_next_one_has_another():
    process = _Process("pymunk", sys.executable)
    assert process.ask("describe")
    process._child.kill()
    process._child.wait()
    process._child.poll = lambda: None  # as if it died while it was asked
    with pytest.raises(RuntimeError, match="the process of engine 'pymunk' ended with -9"):
        process.ask("describe")
    assert process.ask("describe")


_AT_THE_END = """
import atexit, sys
from pendbench.engines import elsewhere
atexit.register(lambda: vars(elsewhere).update(dict.fromkeys(vars(elsewhere))))
print(elsewhere.stand_in("pymunk", sys.executable).version())
kept = elsewhere.stand_in
"""


def test_the_end_of_a_program_that_used_one_is_silent():
    """What outlives its module finds no names there, as where the interpreter itself empties modules at its end."""
    ended = subprocess.run([sys.executable, "-c", _AT_THE_END], capture_output=True, text=True, check=True)
    assert ended.stdout.strip()
    assert ended.stderr == ""


def test_no_process_is_started_to_forget_a_run():
    process = _Process("pymunk", sys.executable)
    process.forget(1)
    assert process._child is None
    assert process.ask("describe")
    process._child.kill()
    ended = process._child
    ended.wait()
    process.forget(1)
    assert process._child is ended


def test_an_engine_that_is_not_there_is_missing():
    with pytest.raises(MissingEngineError, match="engine 'nowhere' of "):
        Elsewhere("nowhere", _Process("nowhere", sys.executable))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("pymunk", "--python is 'pymunk'; allowed: ENGINE=PATH"),
        ("pymunk=", "--python is 'pymunk='; allowed: ENGINE=PATH"),
        (f"pimunk={sys.executable}", "allowed: ENGINE=PATH, ENGINE one of analytic"),
        ("pymunk=/nowhere/python", "no such program; allowed: the Python of an environment"),
        (f"pymunk={os.devnull}", "no such program"),
        ("pymunk=/bin/true", "not a Python with pendbench"),
    ],
)
@pytest.mark.usefixtures("there")
def test_what_is_no_python_of_an_engine_is_one_line(asked, said):
    with pytest.raises(InputError) as caught:
        use([asked], engine_names())
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert python_of("pymunk") is None


def test_a_python_with_another_pendbench_is_one_line(there, monkeypatch):
    monkeypatch.setattr(elsewhere, "source_digest", lambda: "another")
    with pytest.raises(InputError, match="it has another pendbench than this one"):
        use(there, engine_names())


@pytest.mark.usefixtures("there")
def test_a_python_without_pendbench_is_one_line(tmp_path):
    script = tmp_path / "python"
    script.write_text(f'#!/bin/sh\nexec {sys.executable} -S -I "$@"\n')
    script.chmod(0o755)
    with pytest.raises(InputError, match="pendbench; allowed: one with pendbench"):
        use([f"pymunk={script}"], engine_names())


_BUSY = "import time\nfrom pendbench.engines import elsewhere_child\nelsewhere_child.serve=lambda *_: time.sleep(600)\n"


def test_a_process_that_is_busy_ends_with_whoever_asked_it():
    child = f"{_BUSY}elsewhere_child.main()"
    asks = (
        f"import os,subprocess,sys\nprint(subprocess.Popen([sys.executable,'-c',{child!r},'scipy',str(os.getpid())],"
        "stdin=subprocess.PIPE,stdout=subprocess.DEVNULL).pid)"
    )
    told = subprocess.run([sys.executable, "-c", asks], stdout=subprocess.PIPE, check=True)
    pid, patience = int(told.stdout), time.monotonic() + 120.0
    while _runs(pid) and time.monotonic() < patience:
        time.sleep(0.1)
    assert not _runs(pid)


def _runs(pid: int) -> bool:
    """Whether a process has not ended; one whose end nobody has asked for yet has."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
