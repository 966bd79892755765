"""Imports run downwards only: nothing knows what is built on it, and an adapter knows next to nothing."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

import pendbench

PACKAGE = Path(pendbench.__file__).parent

#: The house, from the ground up: a module may import from its own floor and from those below.
FLOORS = (
    ("errors",),
    ("arrays", "bundled", "compiled", "files", "processes", "source", "strict"),
    ("connect", "ranges"),
    ("effects",),
    ("scene", "scene_file", "trajectory"),
    ("solvers",),
    ("physics",),
    ("truth",),
    ("engines",),
    ("recording",),
    ("ensemble",),
    ("study",),
    ("report",),
    ("study.api", "study.__main__"),
)
#: What a part of the house may import of the rest of it, where that is less than its floor would allow.
ONLY = {
    "solvers": {"arrays", "compiled"},
    "physics": {"arrays", "compiled", "effects", "errors", "scene", "solvers"},
    # Rows, and pure functions of arrays.
    "report": {
        "errors",
        "files",
        "strict",
        "trajectory",
        "study.flips",
        "study.measure",
        "study.results",
        "study.verdict",
    },
    # An adapter translates.
    "engines.mujoco": {"arrays", "engines.mjcf", "engines.mujoco_forces", "engines.protocol", "scene", "trajectory"},
    "engines.mujoco_forces": {"arrays", "engines.mjcf", "physics.acting", "scene"},
    "engines.pymunk": {
        "arrays",
        "engines.protocol",
        "engines.pymunk_bodies",
        "engines.pymunk_forces",
        "physics.acting",
        "scene",
        "trajectory",
    },
    "engines.pymunk_bodies": {"arrays", "engines.protocol", "physics.acting", "physics.geometry", "scene"},
    "engines.pymunk_forces": {"arrays", "physics.acting", "physics.geometry", "scene"},
    "engines.pinocchio": {"arrays", "engines.protocol", "physics.acting", "scene", "trajectory"},
    "engines.analytic": {
        "arrays",
        "engines.analytic_runs",
        "engines.protocol",
        "physics",
        "scene",
        "solvers",
        "trajectory",
    },
    "engines.analytic_runs": {"arrays", "engines.protocol", "physics", "scene", "solvers", "trajectory"},
    # Errors and times are taken in separate runs, by modules that do not meet.
    "study.clock": {"arrays", "engines.protocol", "scene"},
    "study.measure": {"arrays"},
    "study.flips": {"arrays"},
    "study.verdict": {"arrays"},
    "study.results": set(),
}
#: Libraries that only these may import.
RESERVED = {
    "mujoco": {"engines.mujoco", "engines.mujoco_forces", "engines.mjcf"},
    "pymunk": {"engines.pymunk", "engines.pymunk_bodies", "engines.pymunk_forces"},
    "heyoka": {"engines.heyoka"},
    "pinocchio": {"engines.pinocchio"},
    "matplotlib": {"report"},
    "pebble": {"study.jobs"},
    "distributed": {"connect", "study.cluster", "study.cluster_worker"},
    "time": {"study.clock", "connect"},  # the second only waits
    "datetime": set(),
    "psutil": {"study"},
    "pydantic": {"scene_file", "strict", "study"},
    "pydantic_core": {"effects.table", "ranges", "strict"},
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


def imports(path: Path) -> set[str]:
    """All that a file imports, inside functions and for types as well, with full names."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("pendbench."):
            found.add(node.value.replace(":", "."))  # loaded by its name
    return found


def ours(path: Path) -> set[str]:
    """The modules of the package that a file imports; of ``a.b.name`` the longest part that is a module."""
    found = set()
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "pendbench":
            inner = [".".join(parts[1:end]) for end in range(len(parts), 1, -1)]
            found |= set([module for module in inner if module in MODULES][:1])
    return found


def libraries(path: Path) -> set[str]:
    return {name.partition(".")[0] for name in imports(path)} - {"pendbench"}


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
    foreign = libraries(MODULES[f"engines.{engine}"]) - set(sys.stdlib_module_names)
    assert foreign <= {"numpy", engine}


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
        ("solvers.explicit", "physics.recursion"),
        ("scene", "physics.energy"),
        ("errors", "strict"),
        ("engines.mujoco", "physics.dense"),
        ("engines.mujoco", "engines.pymunk"),
        ("engines.registry", "recording"),
        ("study.measure", "study.clock"),
        ("study.chaos", "report.chaos"),
        ("study.runner", "study.api"),
        ("report.chaos", "study.runner"),
        ("report.chaos", "engines.registry"),
    ],
)
def test_what_is_forbidden(module, imported):
    assert forbidden(module, imported)


def test_imports_are_seen_wherever_they_are(tmp_path):
    file = tmp_path / "a.py"
    file.write_text(
        "import os.path\nfrom typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pendbench.report import rows\n"
        "def f():\n    from pendbench.physics.dense import accelerations\n    import pendbench.study.api as a\n"
        "    return import_module('pendbench.engines.mujoco'), 'pendbench.truth:reference'\n"
    )
    assert ours(file) == {"report.rows", "physics.dense", "study.api", "engines.mujoco", "truth"}
    assert libraries(file) == {"os", "typing"}
