"""The cache of compiled kernels: a folder for each file and state of its sources, and never in anybody's way."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest

from pendbench.base import compiled
from pendbench.physics.kernels.table import system_of
from pendbench.solvers.trigonometry import cosine_sine
from support.scenes import chain

ADD = "def add(x, y):\n    return x + y\n"

# A plug-in's system, advanced by one of our kernels. The derivative is a file of its own, so that it can be changed.
PLUGIN = """
from typing import NamedTuple
from pendbench.base.compiled import compiled, specialise
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
from pendbench.solvers.methods import fixed_step_methods
euler = fixed_step_methods()["euler"]
state = euler.begin(np.array([1.0]), np.array([0.0]))
euler.advance(Spring(1.0), state, 0, 0.5, 1)
print(state.q[0])
"""
USE_CHAIN = """
import numpy as np
from pendbench.physics.kernels.table import system_of
from pendbench.scene.scene import Effects, Scene
from pendbench.solvers.methods import fixed_step_methods
chain = system_of(Scene("one", "", 1.0, [1.0], [1.0], [0.0], [1.0], Effects(gravity=1.0)))
euler = fixed_step_methods()["euler"]
state = euler.begin(np.array([0.0]), np.array([1.0]))
euler.advance(chain, state, 0, 0.5, 1)
print(state.q[0])
"""
FIND_CHAIN = USE_CHAIN.replace("print(state.q[0])", "print(sum(euler.advance.stats.cache_hits.values()))")
# Plug-ins that give kernels to one of our systems, and to whatever they choose.
LEANING = """
from pendbench.base.compiled import compiled, specialise
from pendbench.physics.kernels.system import System
from pendbench.solvers import problem

@compiled
def expand(system, t, q, v):
    v[1, 0] = 0.0

specialise(problem.rate_series, System, expand)
"""
CHOOSING = """
from pendbench.base.compiled import chosen_by_type
from pendbench.solvers import problem

@chosen_by_type(problem.rate_series)
def choose(system, t, q, v):
    return None
"""
PARTS = """
import math
from pendbench.base.compiled import compiled, inlined, part

@inlined
def halved(x):
    return 0.5 * x

@part
def root(x):
    if x < 0.0:
        raise ValueError("x is below 0")
    return halved(math.sqrt(x))
"""
WHOLES = "".join(
    f"""
from parts import compiled, halved, root

@compiled
def {name}(x, times):
    total = 0.0
    for k in range(times):
        total += root(x)
    return total
"""
    for name in ("sums", "again")
)
# What a kernel finds of another, and how much machine code there is of each: nobody calls that of `root` and `halved`.
USE_PARTS = """
import parts, wholes
found = wholes.KERNEL(16.0, 3)
try:
    wholes.KERNEL(-1.0, 1)
except ValueError as error:
    assert str(error) == "x is below 0"
for kernel, runs in ((wholes.KERNEL, True), (parts.root, False), (parts.halved, False)):
    if not sum(kernel.stats.cache_hits.values()):
        assert all(("\\tret" in code) == runs for code in kernel.inspect_asm().values())
print(found + 100 * sum(parts.root.stats.cache_hits.values()))
"""
# Watches numba compile a kernel for a system with effects, and one in 32 digits; prints how many functions it was.
WATCHED = """
from pathlib import Path
import numpy as np
from numba.core.dispatcher import _FunctionCompiler
from pendbench.base import compiled
from pendbench.physics.extended import inertias
from pendbench.solvers.extended.extrapolation import integrate_extended, neville_weights
from pendbench.physics.kernels.table import system_of
from pendbench.scene.scene import Effects, Scene
from pendbench.solvers.methods import fixed_step_methods

above, seen, compile = [], set(), _FunctionCompiler.compile

def watched(self, *rest):
    file = Path(self.py_func.__code__.co_filename)
    if compiled._PACKAGE in file.parents:
        above.append(file)
        for kernel in above:
            assert file in compiled.sources_of(kernel), (file, kernel)
        seen.add(self.py_func)
    try:
        return compile(self, *rest)
    finally:
        if compiled._PACKAGE in file.parents:
            above.pop()

_FunctionCompiler.compile = watched
acting = Effects(gravity=1.0, joint_damping=0.1, air_drag={"linear": 0.1})
scene = Scene("one", "", 1.0, [1.0], [1.0], [0.0], [1.0], acting)
euler = fixed_step_methods()["euler"]
euler.advance(system_of(scene), euler.begin(scene.angles, scene.rates), 0, 0.5, 1)
system, state = inertias.inertia_form(scene)
integrate_extended(system, neville_weights(4), 0.0, 0.1, 0.1, state, 1.0, np.ones(len(state)), 1e-9, 1)
print(len(seen))
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of kernels, whose cache is in an empty folder: one is a solver's, one arrives in it by type."""
    files = {
        "base/compiled.py": "",
        "solvers/problem.py": "",
        "solvers/stepping.py": "from package.solvers import problem\nfrom package.solvers.adding import add\n",
        "solvers/adding.py": ADD,
        "solvers/other.py": ADD,
        "physics/table.py": "from package.physics import laws\nfrom package.base.compiled import specialise\n",
        "physics/laws.py": "def f():\n    from package.physics.deep import add\n",
        "physics/deep.py": ADD,
        "scene.py": ADD,
    }
    for name, text in files.items():
        (tmp_path / "package" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "package" / name).write_text(text)
    monkeypatch.setattr(compiled, "_PACKAGE", tmp_path / "package")
    monkeypatch.setattr(compiled, "_for_their_own", {})
    monkeypatch.setattr(compiled, "_for_any", {})
    monkeypatch.setattr(compiled.config, "CACHE_DIR", str(tmp_path / "cache"))
    forget()
    yield tmp_path / "package"
    forget()


def forget():
    for function in (
        compiled._inside,
        compiled._imported,
        compiled._arriving_by_type,
        compiled._digest,
        compiled._digest_alone,
        compiled._home,
    ):
        function.cache_clear()


def name_of(source):
    """The cache's name for that file's kernels, as another process would find it."""
    forget()
    return compiled.cache_name(source)


def home():
    forget()
    return compiled._home()


def test_cache_is_where_numba_was_told_to_cache(package):
    assert home() == package.parent / "cache/pendbench"
    assert home().is_dir()


KNOWN = ["solvers/stepping.py", "solvers/adding.py", "solvers/problem.py", "base/compiled.py"]
BY_TYPE = ["physics/table.py", "physics/laws.py", "physics/deep.py"]


@pytest.mark.parametrize("name", [*KNOWN, *BY_TYPE])
def test_name_changes_with_all_that_a_kernel_can_hold(package, name):
    stepping = package / "solvers/stepping.py"
    before = name_of(stepping)
    assert name_of(stepping) == before
    (package / name).write_text((package / name).read_text() + "# changed\n")
    assert name_of(stepping) != before


@pytest.mark.parametrize("name", ["solvers/other.py", "solvers/new.py", "scene.py"])
def test_name_does_not_change_with_anything_else(package, name):
    stepping = package / "solvers/stepping.py"
    before = name_of(stepping)
    (package / name).write_text(ADD.replace("x + y", "x - y"))
    assert name_of(stepping) == before


def test_what_begins_to_arrive_by_type_is_in_every_name(package):
    stepping = package / "solvers/stepping.py"
    before = name_of(stepping)
    (package / "solvers/new.py").write_text("from package.base.compiled import chosen_by_type\n")
    assert name_of(stepping) != before


def test_kernels_from_outside_change_with_every_source(package, tmp_path):
    before = name_of(tmp_path / "mine.py")
    (package / "solvers/other.py").write_text(ADD.replace("x + y", "x - y"))
    assert name_of(tmp_path / "mine.py") != before


def modules(path):
    """What a source imports, as its syntax tree has it."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_no_import_of_a_kernel_is_missed():
    inside = compiled._inside()
    assert len(inside) > 40
    for path in inside.values():
        expected = {inside[name] for name in modules(path) if name in inside}
        assert expected <= compiled._imported(path) <= compiled.sources_of(path)


def test_all_that_is_compiled_into_a_kernel_is_in_its_name(tmp_path):
    """As numba sees it: every function that it compiles on the way to a kernel is in a file that the name has."""
    found = run(WATCHED, tmp_path)
    assert found > 20


def test_nothing_but_two_functions_gives_kernels_by_type():
    """`_arriving_by_type` looks for their names."""
    for path in compiled._inside().values():
        if path.name != "compiled.py":
            assert not {"overload", "overload_method", "register_jitable", "generated_jit"} & set(
                compiled._WORD.findall(path.read_text("utf-8"))
            )


def names_of(source):
    """The cache's names for that file's kernels: the common one's, and that of what is kept apart."""
    forget()
    return compiled.cache_name(source), compiled.cache_name(source, frozenset({"plugin.Spring"}))


def test_what_a_plugin_gives_to_its_own_types_is_in_one_name_and_what_it_gives_to_any_in_both(package, tmp_path):
    stepping, plugin = package / "solvers/stepping.py", tmp_path / "plugin.py"
    plugin.write_text(ADD)
    common, apart = names_of(stepping)
    compiled._know_source(package / "physics/laws.py", compiled._for_any)
    assert names_of(stepping) == (common, apart)
    compiled._know_source(plugin, compiled._for_their_own)
    with_its_own = names_of(stepping)
    assert with_its_own[0] == common
    assert with_its_own[1] != apart
    compiled._know_source(tmp_path / "another.py", compiled._for_any)
    assert not {*names_of(stepping)} & {*with_its_own}


def test_a_source_that_is_edited_after_it_was_imported_is_known_as_it_was(package, tmp_path):
    stepping, plugin = package / "solvers/stepping.py", tmp_path / "plugin.py"
    plugin.write_text(ADD)
    compiled._know_source(plugin, compiled._for_their_own)
    before = names_of(stepping)
    plugin.write_text(ADD.replace("x + y", "x - y"))
    compiled._know_source(plugin, compiled._for_their_own)
    assert names_of(stepping) == before


def test_system_typed_at_a_prompt_trusts_no_cache(package, monkeypatch):
    stepping, names = package / "solvers/stepping.py", set()
    for _ in range(2):
        monkeypatch.setattr(compiled, "_for_their_own", {})
        compiled._know_source(Path("<stdin>"), compiled._for_their_own)
        names.add(names_of(stepping)[1])
    assert len(names) == 2


class Outside(NamedTuple):
    value: float


OURS = numba.typeof(system_of(chain(3, angle=1.0, duration=1.0)))
THEIRS = numba.typeof(Outside(1.0))
KINDS = {
    "numbers": (numba.types.Tuple(tuple(map(numba.typeof, (1.0, 2, True, None, np.zeros(2))))), True),
    "alike": (numba.typeof((1.0, 2.0)), True),
    "ours": (OURS, True),
    "theirs": (THEIRS, False),
    "theirs among others": (numba.types.Tuple((OURS, numba.types.Tuple((THEIRS, THEIRS)))), False),
    "a kernel": (numba.typeof(compiled.part(lambda x: x)), False),
    "a text": (numba.typeof("text"), False),
}


def test_what_is_kept_apart_is_named_after_its_classes(package):
    """Also where it holds kernels of ours alone: a process without the class could not read the common folder then."""
    stepping, spring = package / "solvers/stepping.py", frozenset({"plugin.Spring"})
    assert len({compiled.cache_name(stepping, apart) for apart in (None, frozenset(), spring)}) == 3


def test_classes_from_outside_are_found_in_others():
    nested = numba.types.Tuple((OURS, numba.types.Tuple((THEIRS, THEIRS))))
    assert set(compiled._from_outside([OURS, nested])) == {f"{__name__}.Outside"}


@pytest.mark.parametrize(("kind", "ours"), KINDS.values(), ids=KINDS)
def test_only_types_that_bring_nothing_from_outside_are_ours(kind, ours):
    assert (not list(compiled._from_outside([kind]))) == ours


def test_default_is_the_user_s_cache(package, tmp_path, monkeypatch):  # noqa: ARG001
    monkeypatch.setattr(compiled.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert home().parent == tmp_path / "xdg"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert home().parent == tmp_path / "home/.cache"


def test_unwritable_cache_is_replaced_by_one_for_this_process(package, tmp_path, monkeypatch):  # noqa: ARG001
    (tmp_path / "file").write_text("no folder can be made below a file, whoever tries")
    monkeypatch.setattr(compiled.config, "CACHE_DIR", str(tmp_path / "file/cache"))
    removed = []
    monkeypatch.setattr(compiled.atexit, "register", lambda function, folder, **_: removed.append((function, folder)))
    replacement = home()
    assert replacement.is_dir()
    assert tmp_path not in replacement.parents
    [(function, last)] = removed
    assert last == replacement
    function(last)
    assert not replacement.exists()


def test_numba_s_own_setting_is_left_as_it_was(package):
    before = compiled.config.CACHE_DIR
    kernel = compiled.compiled(lambda x: x + 1)
    kernel(1)
    assert before == compiled.config.CACHE_DIR
    assert Path(kernel.stats.cache_path).is_relative_to(home())
    assert package.exists()


def test_small_kernel_called_from_python_is_an_error_and_no_crash():
    with pytest.raises(TypeError, match="cosine_sine is compiled into other kernels; allowed: a call in one of them"):
        cosine_sine(1.0, 0.0)


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
    assert run(f"import plugin\n{FIND_CHAIN}", cache) == 0
    assert run(f"import plugin\n{FIND_CHAIN}", cache) == 1
    plugin.unlink()
    assert run(FIND_CHAIN, cache) == 1  # with and without the plug-in it is the same kernel


def test_what_a_plugin_gives_to_our_own_types_is_told_from_what_it_gives_to_its(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "plugin.py").write_text(PLUGIN.replace("SIGN", "1.0"))
    (tmp_path / "leaning.py").write_text(LEANING)
    (tmp_path / "choosing.py").write_text(CHOOSING)
    told = "from pendbench.base import compiled\nprint(len(compiled._for_their_own) + 10 * len(compiled._for_any))"
    assert run(told, tmp_path) == 0
    assert run(f"import plugin\n{told}", tmp_path) == 1
    assert run(f"import leaning\n{told}", tmp_path) == 10
    assert run(f"import choosing\n{told}", tmp_path) == 10


@pytest.mark.skipif(numba.version_info.short != compiled.LINKED_WITH, reason="numba compiles parts in its own way")
def test_no_machine_code_is_made_of_what_others_take_in(tmp_path, monkeypatch):
    """And they take it in as well when it comes from the cache."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "parts.py").write_text(PARTS)
    (tmp_path / "wholes.py").write_text(WHOLES)
    assert run(USE_PARTS.replace("KERNEL", "sums"), tmp_path / "cache") == 6.0
    assert run(USE_PARTS.replace("KERNEL", "again"), tmp_path / "cache") == 106.0
    assert run(USE_PARTS.replace("KERNEL", "sums"), tmp_path / "cache") == 6.0  # as a whole from the cache


# What only one kind of system asks for: of which effects, and what other systems are spared.
SPARED = """
import numba
import numpy as np
from pendbench.physics.kernels import both_ends, massless
from pendbench.physics.kernels.table import system_of
from pendbench.scene.scene import Effects, Scene
from pendbench.solvers import problem

@numba.njit
def accelerate(system, t, q, v, a):
    problem.acceleration(system, t, q, v, a)

effects = Effects(gravity=1.0, EFFECT)
scene = Scene("one", "", 1.0, [1.0], [1.0], [0.0], [1.0], effects)
accelerate(system_of(scene), 0.0, np.array([0.5]), np.zeros(1), np.zeros(1))
print(len(massless.inwards.signatures) + 10 * len(both_ends.write_tensions.signatures))
"""


@pytest.mark.parametrize(
    ("effect", "compiled_for"),
    [("joint_damping=0.1", 1), ("driven_pivot={'axis': 'x', 'amplitude': 1, 'angular_frequency': 1}", 10)],
    ids=["pushed", "not pushed"],
)
def test_a_chain_has_one_way_to_its_accelerations_compiled(effect, compiled_for, tmp_path):
    assert run(SPARED.replace("EFFECT", effect), tmp_path) == compiled_for
