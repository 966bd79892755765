"""Imports run downwards only: nothing knows what is built on it, and an adapter knows next to nothing."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import pendbench
from pendbench.study.kinds import kinds

PACKAGE = Path(pendbench.__file__).parent

#: The house, from the ground up: a module may import from its own floor and from those below.
FLOORS = (
    ("base.errors", "base.faults"),
    ("base",),
    ("execution",),
    ("effects",),
    ("scene",),
    ("solvers",),
    ("physics",),
    ("scene.trajectory", "scene.run_file", "scene.picture", "scene.tensions"),  # what a run leaves knows its energy
    ("truth",),
    ("engines",),
    ("measures",),
    ("study",),
    ("report",),
    ("kinds",),
    ("commands",),
    ("study.__main__", "__main__"),
)
#: What adapters of engines in joint angles share.
JOINTED = ("engines.joint_run", "engines.joints", "engines.protocol")
#: What a part of the house may import of the rest of it, where that is less than its floor would allow.
ONLY = {
    "solvers": {"base.arrays", "base.compiled", "base.second_thread"},
    "physics": {"base.arrays", "base.compiled", "base.errors", "effects", "scene", "solvers"},
    # Knows no pendulum.
    "execution": {"base"},
    # Rows, and pure functions of arrays.
    "report": {"base", "scene", "study.case", "study.kinds", "study.results"},
    # An adapter translates.
    "engines.joints": {"base.arrays", "physics.acting", "scene"},
    "engines.mujoco": {"base", "engines.joints", "engines.protocol", "physics.acting", "scene"},
    "engines.pymunk": {
        "base.arrays",
        "base.faults",
        "engines.joints",
        "engines.points",
        "engines.protocol",
        "physics.acting",
        "physics.geometry",
        "scene",
    },
    "engines.pinocchio": {
        "base.arrays",
        "base.faults",
        "engines.joints",
        "engines.protocol",
        "physics.acting",
        "scene",
    },
    "engines.points": {"base.arrays", "engines.protocol", "physics.acting", "physics.geometry", "scene"},
    "engines.scipy": {"base.arrays", "base.faults", "engines.protocol", "physics.acting", "scene"},
    "engines.xpbd": {"", "base", "engines.points", "engines.protocol", "physics.acting", "physics.geometry", "scene"},
    "engines.joint_run": {"base", "engines.joints", "engines.protocol", "physics.acting", "scene"},
    "engines.dart": {"base.arrays", *JOINTED, "engines.silence", "scene"},
    "engines.drake": {"base", *JOINTED, "physics.acting", "scene"},
    "engines.exudyn": {"base", *JOINTED, "physics.acting", "scene"},
    "engines.pybullet": {"base.arrays", *JOINTED, "engines.silence", "scene"},
    "engines.mjx": {"base.faults", "base.files", "engines.joints", "engines.mujoco", "engines.protocol", "scene"},
    "engines.newton": {"base.arrays", *JOINTED, "engines.silence", "physics.acting", "scene"},
    "engines.rapier": {
        "base.faults",
        *JOINTED,
        "engines.points",
        "physics.acting",
        "physics.geometry",
        "scene",
    },
    "engines.box2d": {"base", "engines.points", "engines.protocol", "physics.acting", "scene"},
    "engines.heyoka": {"base.faults", "effects", "engines.protocol", "scene"},
    # A kind knows no other.
    **{f"kinds.{name}": {part for parts in FLOORS[:-3] for part in parts} for name in kinds()},
    # The source of what runs in workers is in every key, and so is all that it imports: pages are not.
    **{f"kinds.{name}.work": {part for parts in FLOORS[:-4] for part in parts} for name in kinds()},
    # Errors and times are taken in separate runs, by modules that do not meet.
    "measures.clock": {"base.arrays", "base.faults", "base.second_thread", "engines.protocol", "scene"},
    "measures.orders": {"base.arrays"},
    "measures.prices": {"base.arrays"},
    "measures.divergence": {"base.arrays"},
    "measures.drift": {"base.arrays"},
    "measures.flips": {"base.arrays"},
    "measures.verdict": {"base.arrays"},
    "study.results": set(),
}
#: Libraries that only these may import.
RESERVED = {
    "mujoco": {"engines.mjx", "engines.mujoco", "scene.models"},
    "jax": {"engines.mjx"},
    "newton": {"engines.newton"},
    "warp": {"engines.newton"},
    "pymunk": {"engines.pymunk"},
    "heyoka": {"engines.heyoka"},
    "pyb2d3": {"engines.box2d"},
    "dartpy": {"engines.dart"},
    "exudyn": {"engines.exudyn"},
    "pydrake": {"engines.drake"},
    "rapier3d": {"engines.rapier"},
    "pybullet": {"engines.pybullet"},
    "pinocchio": {"engines.pinocchio"},
    "matplotlib": {"report", "kinds", "scene.trajectory", "scene.picture"},
    "pebble": {"execution.pool"},
    "argcomplete": {"__main__", "commands"},
    "distributed": {"execution"},
    "flint": {"truth.proof"},
    # `execution.connect` only waits.
    "time": {"measures.clock", "base.second_thread", "execution.connect", "truth.proof.enclose"},
    "datetime": set(),
    "psutil": {"study", "base.processes"},
    "pydantic": {"base.strict", "scene.toml_file", "study", "kinds", "commands.pages"},
    "pydantic_core": {"base.ranges", "base.strict", "effects.table"},
}
#: Equations and methods know no file and no clock.
PURE = ("physics", "solvers")
IMPURE = {"io", "os", "pathlib", "random", "tempfile", "time"}


def short(path: Path) -> str:
    """A module's name inside the package; of a package, its folder's."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {short(path): path for path in sorted(PACKAGE.rglob("*.py"))}
INSIDE = sorted(set(MODULES) - {""})


def imports(path: Path) -> frozenset[str]:
    """All that a file imports, inside functions and for types as well, with full names."""
    return _imports(path.read_text("utf-8"))


@cache
def _imports(text: str) -> frozenset[str]:
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"a relative import: {ast.unparse(node)}"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("pendbench."):
            found.add(node.value.replace(":", "."))  # loaded by its name
    return frozenset(found)


def ours(path: Path) -> set[str]:
    """The modules of the package that a file imports; of ``a.b.name`` the longest part that is a module.

    A public name is of the module that it is from, and the package as a whole holds all of them.
    """
    found = set()
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "pendbench":
            inner = [".".join(parts[1:end]) for end in range(len(parts), 1, -1)]
            public = [_public(parts[1])] if len(parts) > 1 else map(_public, pendbench.__all__)
            found |= set([module for module in inner if module in MODULES][:1] or filter(None, public))
    return found


def _public(name: str) -> str:
    """The module that a public name is from."""
    return pendbench._HOMES.get(name, "").removeprefix("pendbench.")


def libraries(path: Path) -> frozenset[str]:
    return frozenset(name.partition(".")[0] for name in imports(path)) - {"pendbench"}


def within(module: str, part: str) -> bool:
    return module == part or module.startswith(f"{part}.")


def floor(module: str) -> int:
    """How high a module is. A part's own line counts before that of the part it is in."""
    found = [(len(part), height) for height, parts in enumerate(FLOORS) for part in parts if within(module, part)]
    assert found, f"{module} has no floor: give it one in FLOORS"
    return max(found)[1]


def forbidden(module: str, imported: str) -> bool:
    allowed = [parts for part, parts in ONLY.items() if within(module, part) and not within(imported, part)]
    return floor(imported) > floor(module) or any(
        not any(within(imported, part) for part in parts) for parts in allowed
    )


@pytest.mark.parametrize("module", INSIDE)
def test_imports_run_downwards(module):
    assert not {imported for imported in ours(MODULES[module]) if forbidden(module, imported)}


@pytest.mark.parametrize("module", INSIDE)
def test_each_library_has_its_place(module):
    for library, places in RESERVED.items():
        if library in libraries(MODULES[module]):
            assert any(within(module, place) for place in places), f"{library} has no place in {module}"
    if any(within(module, part) for part in PURE):
        assert not libraries(MODULES[module]) & IMPURE


@pytest.mark.parametrize("engine", ["mujoco", "pymunk", "analytic", "heyoka", "pinocchio"])
def test_an_adapter_imports_its_own_library_and_numpy(engine):
    its = [path for module, path in MODULES.items() if within(module, f"engines.{engine}")]
    foreign = set().union(*map(libraries, its)) - set(sys.stdlib_module_names)
    assert its
    assert foreign <= {"numpy", engine}


def test_a_worker_loads_no_library_that_its_first_job_may_not_need():
    """They take from a quarter of a second to a whole one, of every process."""
    names = ", ".join(f"pendbench.kinds.{name}.work" for name in kinds())
    heavy = ("matplotlib", "mujoco", "pandas", "pydantic", "pymunk", "scipy.integrate", "scipy.linalg")
    code = f"import sys, {names}; print(*sorted(set({heavy}) & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []


def test_a_study_on_the_command_line_waits_for_no_table_or_plot():
    code = "import sys, pendbench.commands.run; print(*sorted({'matplotlib', 'numba', 'pandas'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []


def test_every_part_named_here_exists():
    named = (
        {part for parts in FLOORS for part in parts} | set(ONLY) | {part for parts in ONLY.values() for part in parts}
    )
    named |= {place for places in RESERVED.values() for place in places}
    assert named <= {*MODULES, *(module.partition(".")[0] for module in MODULES)}
    assert len(INSIDE) > 40


@pytest.mark.parametrize(
    ("module", "imported"),
    [
        ("physics.energy", "engines.protocol"),
        ("solvers.explicit", "physics.kernels.recursion"),
        ("scene.scene", "physics.energy"),
        ("base.errors", "base.strict"),
        ("execution.store", "scene.scene"),
        ("engines.mujoco.adapter", "physics.dense"),
        ("engines.mujoco.adapter", "engines.pymunk.adapter"),
        ("measures.orders", "measures.clock"),
        ("kinds.chaos.study", "kinds.cost.study"),
        ("kinds.chaos.work", "kinds.chaos.columns"),
        ("kinds.chaos.work", "report.numbers"),
        ("study.plan", "report.names"),
        ("study.plan", "commands.run"),
        ("report.names", "study.plan"),
        ("report.names", "engines.registry"),
    ],
)
def test_what_is_forbidden(module, imported):
    assert forbidden(module, imported)


def test_imports_are_seen_wherever_they_are(tmp_path):
    file = tmp_path / "a.py"
    file.write_text(
        "import os.path\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pendbench.report import names\n"
        "def f():\n    from pendbench.physics.dense import accelerations\n    import pendbench.commands.run as a\n"
        "    return import_module('pendbench.engines.mujoco.adapter'), 'pendbench.truth.reference:reference'\n"
    )
    assert ours(file) == {"report.names", "physics.dense", "commands.run", "engines.mujoco.adapter", "truth.reference"}
    assert libraries(file) == {"os", "typing"}


def test_public_names_are_imports_of_where_they_are_from(tmp_path):
    file = tmp_path / "a.py"
    file.write_text("from pendbench import __version__\ndef f():\n    from pendbench import show, Scene\n")
    assert ours(file) == {"commands.showing", "scene.scene"}
    for whole in ("import pendbench\n", "import pendbench as pb\n"):
        file.write_text(whole)
        assert {"commands.showing", "scene.scene", "truth.reference"} <= ours(file)
    file.write_text("import pendbench.solvers\n")
    assert ours(file) == {"solvers"}
