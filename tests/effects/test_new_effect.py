"""Someone adds an effect as `effects/term.py` says, in a copy of the project: everything simulates it from there."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pendbench

CUBIC_SPRING = """
from typing import Any, Final, NamedTuple

from pendbench.base.arrays import FloatArray
from pendbench.effects.term import each
from pendbench.base.ranges import EachOf, Range

CUBIC_SPRING: Final = EachOf(Range(0.0, 1e50, "N m/rad^3"), "joint")

class CubicSpring(NamedTuple):
    stiffness: FloatArray

    @classmethod
    def of(cls, value, n):
        return cls(each(value, n, "cubic_spring", "joints"))

    @staticmethod
    def example():
        return 2.0

    def is_nothing(self):
        return not self.stiffness.any()

    @staticmethod
    def joint_torque(term, drive, i, bend, rate):
        return -(term.stiffness[i] * bend * bend * bend)

    @staticmethod
    def joint_potential(term, i, bend):
        return 0.25 * term.stiffness[i] * bend * bend * bend * bend
"""
# Of the other kind: no force, but an acceleration that does not change.
TILT = """
from typing import Any, Final, NamedTuple

from pendbench.base.ranges import Range

TILT: Final = Range(-1e50, 1e50, "m/s^2")

class Tilt(NamedTuple):
    sideways: float

    @classmethod
    def of(cls, value, n):
        return cls(value)

    @staticmethod
    def example():
        return 2.0

    def is_nothing(self):
        return self.sideways == 0.0

    @staticmethod
    def pivot_acceleration(term, t):
        return term.sideways, 0.0

    @staticmethod
    def mass_potential(term, x, y):
        return term.sideways * x
"""
IMPORT = """
from pendbench.effects.cubic_spring import CUBIC_SPRING, CubicSpring
from pendbench.effects.tilt import TILT, Tilt
"""
LINE = """
    cubic_spring: Annotated[Each, CUBIC_SPRING, CubicSpring] | None = None
    tilt: Annotated[float, TILT, Tilt] | None = None
"""
IMPORTED = "from pendbench.effects.driven_pivot import"
LISTED = "    gravity: Annotated"
# A method of each, by which the kit looks at each effect alone: of ours the one that is compiled soonest.
METHODS = {"analytic": "rk4", "mujoco": "euler", "pinocchio": "rk4", "pymunk": "default"}
# What these make of both, and that an adapter without their lines refuses them.
USED = """
import sys

import numpy as np
from pendbench.engines.conformance import effects as kit
from pendbench.engines.conformance.check import Subject, findings
from pendbench.engines.protocol import refusal
from pendbench.engines.registry import engine
from pendbench.base.errors import MissingEngineError
from pendbench.physics.kernels import recursion
from pendbench.physics import dense
from pendbench.scene.scene import load_scene

scene = load_scene("scene.toml")
args = scene.angles, scene.rates, 0.3
np.testing.assert_allclose(recursion.accelerations(scene, *args), dense.accelerations(scene, *args), rtol=1e-12)
try:
    assert "cubic_spring" in refusal(engine("heyoka"), "taylor", scene)
except MissingEngineError:
    pass
# The kit looks at the two alone: the others are as they were, and compiling their kernels again takes a minute.
mapped = kit.mapped_effects
kit.mapped_effects = lambda engine: {name: mapped(engine)[name] for name in ("cubic_spring", "tilt")}
kit.names_of_effects = lambda: ("cubic_spring", "tilt")
given = sys.argv[1:]
for name, method in zip(given[: len(given) // 2], given[len(given) // 2 :]):
    assert refusal(engine(name), method, scene) is None, name
    found = findings(kit.simulates_the_effects_it_maps, Subject(engine(name), method))
    print(name, *(finding.line for finding in found if not finding.good))
"""
SCENE = """
duration = 1
chain = {masses = [1.0, 0.5], lengths = [1.0, 0.7]}
start = {angles = [0.3, 0.9]}
effects = {gravity = 9.81, cubic_spring = [1.0, 2.0], tilt = 3.0}
"""


def test_an_effect_of_ones_own_needs_its_file_its_line_and_a_line_in_each_adapter(tmp_path):
    package = tmp_path / "pendbench"
    shutil.copytree(Path(pendbench.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "effects/cubic_spring.py").write_text(CUBIC_SPRING)
    (package / "effects/tilt.py").write_text(TILT)
    page = (package / "effects/__init__.py").read_text()
    page = page.replace(IMPORTED, f"{IMPORT}\n{IMPORTED}", 1).replace(LISTED, f"{LINE}\n{LISTED}", 1)
    (package / "effects/__init__.py").write_text(page)
    able = {name: method for name, method in METHODS.items() if name != "pinocchio" or _there("pinocchio")}
    for name in able:
        adapter = next(iter((package / "engines").glob(f"{name}.py")), package / "engines" / name / "adapter.py")
        line = '"cubic_spring": Mapped("as it is"), "tilt": Mapped("as gravity"), '
        adapter.write_text(adapter.read_text().replace("_EFFECTS: Final = {", f"_EFFECTS: Final = {{{line}", 1))
    (tmp_path / "scene.toml").write_text(SCENE)
    settings = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    call = [sys.executable, "-c", USED, *able, *able.values()]
    done = subprocess.run(call, cwd=tmp_path, env=settings, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == list(able)  # no failure beside any


def _there(package: str) -> bool:
    try:
        __import__(package)
    except ImportError:
        return False
    return True
