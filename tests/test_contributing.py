"""CONTRIBUTING tells the truth: each thing that one can add, added to a copy of the project by the files it names."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

SCENE = """
# Two links that a newcomer adds.
duration = 1.0

[chain]
masses  = [1.0, 0.5]
lengths = [1.0, 0.7]

[start]
angles = [0.3, 0.9]

[effects]
gravity = 9.81
"""

ENGINE = '''
"""Semi-implicit steps of a single pendulum."""
import numpy as np

from pendbench.engines.protocol import Method, State


class Run:
    def __init__(self, scene, dt):
        self.scene, self.dt, self.theta, self.omega = scene, dt, scene.angles.copy(), scene.rates.copy()

    def advance(self, steps):
        for _ in range(steps):
            self.omega = self.omega - self.dt * self.scene.effects.gravity / self.scene.lengths * np.sin(self.theta)
            self.theta = self.theta + self.dt * self.omega

    def state(self):
        return State(self.theta, self.omega)

    def health(self):
        return None


class Plain:
    name = "plain"
    methods = {"euler": Method(order=1)}

    def version(self):
        return "1"

    def refuses(self, scene):
        return None if scene.n == 1 else "one link is all it knows"

    def build(self, scene, method, dt):
        return Run(scene, dt)
'''

METHOD = '''
"""Heun's method."""
import numpy as np

from pendbench.solvers.explicit import Tableau, runge_kutta_method
from pendbench.solvers.methods import add

HEUN = Tableau(a=np.array([[0.0, 0.0], [1.0, 0.0]]), b=np.array([0.5, 0.5]), c=np.array([0.0, 1.0]), order=2)

add(runge_kutta_method("heun", HEUN, note="two stages"))
'''

STUDY = '''
"""How many steps does each case take?"""
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from pendbench.execution.tasks import task
from pendbench.kinds.tally.work import Tally, count
from pendbench.study.ask import refused
from pendbench.study.case import Case
from pendbench.study.study_file import StudyFile



class Options(StudyFile):
    """What it asks besides."""

    until: Annotated[float, Field(gt=0)] = 1.0
    """s"""


@dataclass(frozen=True)
class Found:
    tallies: dict[Case, Tally]


def check(plan):
    """Nothing more."""


def measure(plan, runner):
    refusals = refused(runner, plan.cases)
    able = {case: task(count, case, plan.options.until) for case in plan.cases if case not in refusals}
    return Found(runner.run("counted", able) | {case: Tally(*fault) for case, fault in refusals.items()})
'''
WORK = '''
"""What it runs."""
from dataclasses import dataclass

from pendbench.engines.recording import simulate
from pendbench.study.case import Case


@dataclass(frozen=True)
class Tally:
    status: str
    reason: str = ""
    steps: int | None = None


def count(case: Case, until: float) -> Tally:
    run = simulate(case.scene, case.engine, case.method, case.dt, [until])
    return Tally(run.status, run.reason, run.steps)
'''
COLUMNS = '''
"""Its columns."""
from dataclasses import dataclass

from pendbench.kinds.tally.work import Tally
from pendbench.report.columns import CASE, ENDING, STEPS, Column, Table
from pendbench.study.case import Case

SUMMARY = ("scene", "engine", "steps")


@dataclass(frozen=True)
class Row:
    case: Case
    tally: Tally

    @property
    def status(self):
        return self.tally.status

    @property
    def reason(self):
        return self.tally.reason


COLUMNS = {
    "cases": (
        *CASE,
        *ENDING,
        STEPS.at(lambda row: row.tally.steps),
    )
}


def tables(results):
    return [Table("cases", COLUMNS["cases"], [Row(*both) for both in results.found.tallies.items()])]
'''
COLUMN = """        Column("joints", "1", "d", "joints", "as many as links", lambda row: row.case.scene.n),
"""
STUDY_FILE = """
title  = "Steps"
kind   = "tally"
scenes = ["mine", "single"]

[[engines]]
name    = "mujoco"
methods = ["euler"]
dt      = [1e-2]

[[engines]]
name    = "plain"
methods = ["euler"]
dt      = [1e-2]
"""
VERB = '''"""`pendbench links`: say how many links a scene has."""


def add_options(options):
    options.add_argument("scene")


def run(chosen):
    print(count_links(chosen.scene))
    return 0


def count_links(scene):
    """How many links a scene has."""
    import pendbench as pb

    return pb.load_scene(scene).n
'''


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the project, to which a newcomer adds things."""
    folder = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "src", folder / "src", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("models", "studies", "docs"):
        shutil.copytree(ROOT / name, folder / name)
    (folder / "models/mine.toml").write_text(SCENE)
    package = folder / "src/pendbench"
    (package / "engines/plain.py").write_text(ENGINE)
    line = '    "plain": ("pendbench.engines.plain:Plain", "pendbench"),\n'
    put(package / "engines/registry.py", '    "analytic": (', line)
    (package / "solvers/heun.py").write_text(METHOD)
    kind = package / "kinds/tally"
    kind.mkdir()
    for name, text in (("__init__", ""), ("study", STUDY), ("work", WORK), ("columns", COLUMNS)):
        (kind / f"{name}.py").write_text(text)
    put(kind / "columns.py", "        STEPS.at(", COLUMN)
    (package / "commands/links.py").write_text(VERB)
    put(package / "__init__.py", '    "energy": ', '    "count_links": "pendbench.commands.links",\n')
    put(package / "__init__.py", '    "energy",', '    "count_links",\n')
    (folder / "steps.toml").write_text(STUDY_FILE)
    return folder


def put(file: Path, before: str, line: str) -> None:
    text = file.read_text()
    assert text.count(before) == 1
    file.write_text(text.replace(before, f"{line}{before}"))


def run(folder: Path, *arguments: str) -> str:
    settings = {**os.environ, "PYTHONPATH": str(folder / "src")}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=settings, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_scene_is_a_file(copy):
    run(copy, "-m", "pendbench.engines.mujoco.mjcf")
    assert (copy / "models/mjcf/mine.xml").is_file()
    assert run(copy, "-c", "import pendbench as pb; print(pb.load_scene('mine').n)").strip() == "2"


def test_an_engine_is_a_file_and_a_line(copy):
    code = "import pendbench as pb; print(pb.simulate('single', 'plain', 'euler', 1e-3, [1.0]).steps)"
    assert run(copy, "-c", code).strip() == "1000"


def test_a_verb_of_the_command_is_a_file(copy):
    assert run(copy, "-m", "pendbench", "links", "triple").strip() == "3"
    assert "say how many links a scene has" in run(copy, "-m", "pendbench", "--help")


def test_a_public_name_is_a_few_lines(copy):
    assert run(copy, "-c", "import pendbench as pb; print(pb.count_links('triple'))").strip() == "3"


def test_a_method_is_a_file(copy):
    code = (
        "import numpy as np, pendbench as pb\n"
        "truth = pb.simulate('double', times=[0.5]).theta\n"
        "errors = [np.abs(pb.simulate('double', 'analytic', 'heun', dt, [0.5]).theta - truth).max()"
        " for dt in (2e-3, 1e-3)]\n"
        "print(np.log2(errors[0] / errors[1]))"
    )
    assert abs(float(run(copy, "-c", code)) - 2.0) < 0.1


def test_a_kind_is_a_folder_and_a_column_a_line(copy):
    out = run(copy, "-m", "pendbench.study", "steps.toml", "--out", "out", "--jobs", "2")
    assert "3 cases of 4 ended well." in " ".join(out.split())
    lines = (copy / "out/cases.csv").read_text().splitlines()
    assert lines[0] == "scene,n,engine,method,dt,settings,status,reason,joints,steps"
    assert "mine,2,mujoco,euler,0.01,,ok,,2,100" in lines
    assert "single,1,plain,euler,0.01,,ok,,1,100" in lines
    assert any(line.startswith("mine,2,plain,euler,0.01,,refused,one link is all it knows") for line in lines)
    page = (copy / "out/report.md").read_text()
    assert "one link is all it knows" in page
    run(copy, "-m", "pendbench.commands.pages")
    assert "## Kind `tally`" in (copy / "docs/columns.md").read_text()
    assert "`until`" in (copy / "docs/study_files.md").read_text()
    assert "## `count_links`" in (copy / "docs/api.md").read_text()


def test_every_module_with_mutants_has_tests_of_its_own():
    config = tomllib.loads((ROOT / "tests/mutants.toml").read_text())
    modules = config["cosmic-ray"]["module-path"]
    assert [f"src/pendbench/{module}" for module in config["tests"]] == modules
    named = [argument for arguments in config["tests"].values() for argument in arguments if ".py" in argument]
    assert all((ROOT / path).is_file() for path in [*modules, *named])


#: What stands for a name, or for what a reader makes.
PLACEHOLDERS = re.compile(r"NAME|heun\.py|report\.md|my_package")
NAMED = re.compile(r"`([A-Za-z_/]+\.(?:py|js|md\.j2|toml|xml))`")


def test_every_file_that_a_document_names_is_there():
    rooms = [ROOT / name for name in ("src", "tests", "docs", "models", "studies", "benchmarks")]
    listed = [f"/{path.relative_to(ROOT)}" for room in rooms for path in room.rglob("*.*")] + ["/pyproject.toml"]
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "src").rglob("*.py")]
    gone = {
        f"{page.relative_to(ROOT)}: {name}"
        for page in pages
        for name in NAMED.findall(page.read_text("utf-8"))
        if not PLACEHOLDERS.search(name) and not any(path.endswith(f"/{name}") for path in listed)
    }
    assert not gone
