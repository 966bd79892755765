"""Machine code on disk: found again by every copy of the source, never another's, and never a reason to fail."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pendbench
from pendbench.base import compiled, machine_code

# A kernel of ours: which project it is of, what it finds, whether its machine code was there, and whether numba had to
# load all that it can compile.
USE = """
import sys
import pendbench
from pendbench.solvers.crossing import first_crossing
found = round(first_crossing(0.0, 1.0, 1.0, 1.0, 0.5), 9)
print(pendbench.__file__, found, sum(first_crossing.stats.cache_hits.values()), "numba.np.arraymath" in sys.modules)
"""


# Kernels from outside. What they use of numba's library comes with them. Those that call each other cannot be loaded.
KERNELS = """
import ctypes
from numba import types
from pendbench.base.compiled import compiled
WORDS = ("a longer text", "another")

class Cosine(types.WrapperAddressProtocol):
    def __wrapper_address__(self):
        return ctypes.cast(ctypes.CDLL(None).cos, ctypes.c_void_p).value
    def signature(self):
        return types.float64(types.float64)

@compiled
def same(which, its_hash): return hash(WORDS[which]) == its_hash
@compiled
def called(function, x): return function(x)
@compiled
def even(n): return n == 0 or odd(n - 1)
@compiled
def odd(n): return n != 0 and even(n - 1)
@compiled
def both(which, its_hash, n): return same(which, its_hash) and even(n)
"""
CALLS = """
from kernels import Cosine, both, called, even, same
text = hash("a longer text")
print(same(0, text), called(Cosine(), 0.0), even(4), both(0, text, 4), sum(same.stats.cache_hits.values()))
"""

ABSOLUTE = ctypes.CDLL(None).labs
ABSOLUTE.argtypes, ABSOLUTE.restype = [ctypes.c_long], ctypes.c_long


FACTOR = 2.0


def kernel(times: float = 2.0):
    """A kernel made anew, as in another process; times: a constant in it."""

    @compiled.compiled
    def scaled(x):
        return times * x

    return scaled


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled.config, "CACHE_DIR", str(tmp_path))
    compiled._home.cache_clear()
    yield tmp_path / "pendbench"
    compiled._home.cache_clear()


def hits(its) -> int:
    return sum(its.stats.cache_hits.values())


def kept(folder) -> list[Path]:
    return sorted(folder.glob("*/*.kernel"))


def test_a_file_for_each_set_of_types_found_whoever_wrote_the_other(folder):
    assert kernel()(1.5) == 3.0
    assert kernel()(2) == 4.0
    assert len(kept(folder)) == 2
    again = kernel()
    assert (again(1.5), again(2), hits(again)) == (3.0, 4.0, 2)


def test_constants_that_a_kernel_has_from_around_it_are_part_of_what_it_is(folder):
    assert kernel(2.0)(1.5) == 3.0
    another = kernel(3.0)
    assert (another(1.5), hits(another)) == (4.5, 0)
    assert len(kept(folder)) == 2


def turned(was: bytes) -> bytes:
    """With one bit turned, somewhere in the machine code."""
    at = len(was) // 2
    return was[:at] + bytes([was[at] ^ 1]) + was[at + 1 :]


@pytest.mark.parametrize(
    "damage",
    [lambda _: b"", lambda _: b"no pickle", lambda was: was[:-100], turned],
    ids=["empty", "text", "cut", "a bit"],
)
def test_a_file_that_cannot_be_read_is_written_again(folder, damage):
    kernel()(1.5)
    (path,) = kept(folder)
    path.write_bytes(damage(path.read_bytes()))
    for found in (0, 1):
        again = kernel()
        assert (again(1.5), hits(again)) == (3.0, found)


def test_a_file_of_another_kernel_by_that_name_is_not_used(folder):
    kernel(3.0)(1.5)
    (theirs,) = kept(folder)
    kernel(2.0)(1.5)
    (ours,) = set(kept(folder)) - {theirs}
    shutil.copy(theirs, ours)
    again = kernel(2.0)
    assert (again(1.5), hits(again)) == (3.0, 0)


@pytest.mark.parametrize("name", ["<stdin>", "plugin.py"])
def test_a_kernel_that_is_defined_again_is_not_the_one_before(folder, monkeypatch, name):
    """At a prompt, or in a file that is edited and loaded again: the same name and line, and other constants."""
    monkeypatch.chdir(folder.parent)
    for times in (2.0, 3.0):
        text = f"from pendbench.base.compiled import compiled\n@compiled\ndef scaled(x): return {times} * x\n"
        if name == "plugin.py":
            Path(name).write_text(text)
        found: dict = {}
        exec(compile(text, name, "exec"), found)
        assert found["scaled"](1.5) == times * 1.5


def test_a_kernel_that_is_told_to_compile_again_does_so_and_the_others_find_what_was_kept(folder, monkeypatch):
    @compiled.compiled
    def scaled(x):
        return FACTOR * x

    assert scaled(1.5) == 3.0
    monkeypatch.setitem(globals(), "FACTOR", 3.0)
    scaled.recompile()
    assert scaled(1.5) == 4.5
    assert len(kept(folder)) == 2


def test_what_cannot_be_kept_is_compiled_and_works(folder, monkeypatch):
    def full(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(machine_code, "write_whole", full)
    assert kernel()(1.5) == 3.0
    assert kept(folder) == []


def test_addresses_of_this_process_are_not_kept(folder):
    """Of a function in C, for one: in another process that is elsewhere."""

    @compiled.compiled
    def called(x):
        return ABSOLUTE(x)

    assert called(-2) == 2
    assert kept(folder) == []


def test_what_is_found_works_as_what_was_compiled(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS)
    variables = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for found in (0, 1):
        ran = subprocess.run([sys.executable, "-c", CALLS], env=variables, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stderr
        assert ran.stdout.split() == ["True", "1.0", "True", "True", str(found)]


def test_a_copy_of_the_project_uses_what_this_one_compiled(tmp_path):
    """The path of a source is nowhere in the name, nor the time of it. Nothing else is loaded."""
    source = Path(pendbench.__file__).parent
    shutil.copytree(source, tmp_path / "copy/pendbench", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "copy/pendbench/__init__.py").touch()
    found = {}
    for folder in (source.parent, tmp_path / "copy"):
        variables = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        ran = subprocess.run([sys.executable, "-c", USE], env=variables, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stderr
        file, *rest = ran.stdout.split()
        found[Path(file).parents[1]] = rest
    assert found[source.parent] == ["0.5", "0", "True"]
    assert found[tmp_path / "copy"] == ["0.5", "1", "False"]
