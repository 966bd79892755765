"""The cache of compiled kernels: one folder for each state of the sources, and never in anybody's way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pendbench import compiled

ADD = "def add(x, y):\n    return x + y\n"

# A plug-in's system, advanced by one of our kernels. The derivative is a file of its own, so that it can be changed.
PLUGIN = """
from typing import NamedTuple
from pendbench.compiled import compiled, specialise
from pendbench.solvers import problem

class Spring(NamedTuple):
    stiffness: float

@compiled
def pull(system, t, q, v, a):
    a[0] = -SIGN * system.stiffness * q[0]

specialise(problem.acceleration, Spring, pull)
"""
USE_PLUGIN = """
import numpy as np
from plugin import Spring
from pendbench.solvers.explicit import semi_implicit_euler
q, v = np.array([1.0]), np.array([0.0])
semi_implicit_euler(Spring(1.0), 0, 0.5, q, v, 1)
print(q[0])
"""
USE_CHAIN = """
import numpy as np
from pendbench.physics.recursion import system_of
from pendbench.scene import Effects, Scene
from pendbench.solvers.explicit import semi_implicit_euler
chain = system_of(Scene("one", "", 1.0, [1.0], [1.0], [0.0], [1.0], Effects(gravity=1.0)))
q, v = np.array([0.0]), np.array([1.0])
semi_implicit_euler(chain, 0, 0.5, q, v, 1)
print(q[0])
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two kernels, whose cache is in an empty folder."""
    for folder in ("physics", "solvers"):
        (tmp_path / "package" / folder).mkdir(parents=True)
    (tmp_path / "package/compiled.py").write_text("")
    (tmp_path / "package/physics/adding.py").write_text(ADD)
    monkeypatch.setattr(compiled, "_PACKAGE", tmp_path / "package")
    monkeypatch.setattr(compiled, "_sources_outside", [])
    monkeypatch.setattr(compiled.config, "CACHE_DIR", str(tmp_path / "cache"))
    forget()
    yield tmp_path / "package"
    forget()


def forget():
    compiled._digest.cache_clear()
    compiled._writable_folder.cache_clear()


def folder():
    forget()
    return Path(compiled.cache_folder())


def test_folder_is_where_numba_was_told_to_cache(package):
    assert folder().parents[1] == package.parent / "cache"
    assert folder().is_dir()


@pytest.mark.parametrize("name", ["compiled.py", "physics/adding.py", "physics/new.py", "solvers/new.py"])
def test_folder_changes_with_any_source_of_kernels(package, name):
    before = folder()
    assert folder() == before
    (package / name).write_text(ADD.replace("x + y", "x - y"))
    assert folder() != before


def test_folder_does_not_change_with_other_sources(package):
    before = folder()
    (package / "scene.py").write_text(ADD)
    assert folder() == before


def test_folder_changes_with_a_system_from_outside(package, tmp_path, monkeypatch):
    before, plugin = folder(), tmp_path / "plugin.py"
    plugin.write_text(ADD)
    monkeypatch.setattr(compiled, "_kernels", [])
    compiled._know_source(package / "physics/adding.py")
    assert folder() == before
    compiled._know_source(plugin)
    assert folder() != before


def test_system_typed_at_a_prompt_trusts_no_cache(package, monkeypatch):  # noqa: ARG001
    monkeypatch.setattr(compiled, "_sources_outside", [Path("<stdin>")])
    assert folder() != folder()


def test_default_is_the_user_s_cache(package, tmp_path, monkeypatch):  # noqa: ARG001
    monkeypatch.setattr(compiled.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert folder().parents[1] == tmp_path / "xdg"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert folder().parents[1] == tmp_path / "home/.cache"


def test_unwritable_cache_is_replaced_by_one_for_this_process(package, tmp_path, monkeypatch):  # noqa: ARG001
    (tmp_path / "file").write_text("no folder can be made below a file, whoever tries")
    monkeypatch.setattr(compiled.config, "CACHE_DIR", str(tmp_path / "file/cache"))
    removed = []
    monkeypatch.setattr(compiled.atexit, "register", lambda function, folder, **_: removed.append((function, folder)))
    replacement = folder()
    assert replacement.is_dir()
    assert tmp_path not in replacement.parents
    [(function, last)] = removed
    assert last == str(replacement)
    function(last)
    assert not replacement.exists()


def test_numba_s_own_setting_is_left_as_it_was(package):
    before = compiled.config.CACHE_DIR
    kernel = compiled.compiled(lambda x: x + 1)
    compiled._kernels.remove(kernel)
    assert before == compiled.config.CACHE_DIR
    assert kernel.stats.cache_path.startswith(str(folder()))
    assert package.exists()


def run(script, cache):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


def test_plugin_s_kernels_are_neither_stale_nor_in_the_way_of_others(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    plugin, cache = tmp_path / "plugin.py", tmp_path / "cache"
    plugin.write_text(PLUGIN.replace("SIGN", "1.0"))
    assert run(USE_PLUGIN, cache) == 0.75
    plugin.write_text(PLUGIN.replace("SIGN", "2.0"))
    assert run(USE_PLUGIN, cache) == 0.5
    plugin.unlink()
    assert run(USE_CHAIN, cache) == 0.5
