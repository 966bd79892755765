"""Engines are found by name, loaded when asked for, and one that is broken says so in one line."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path

import pytest

from pendbench.base.errors import InputError, MissingEngineError
from pendbench.engines import registry
from pendbench.engines.analytic.adapter import AnalyticEngine
from pendbench.engines.registry import engine, engine_names

GOOD = """
    from pendbench.engines.protocol import Method

    class Made:
        name = "outside"
        methods = {"rk4": Method(order=4)}
        def version(self): return "1"
        def refuses(self, scene): return None
        def build(self, scene, method, dt, **settings): raise NotImplementedError
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A function that installs a package with one module and one entry point, for the length of a test."""

    def install(code: str, name: str = "outside", distribution: str = "pendbench-outside") -> None:
        module = distribution.replace("-", "_")
        folder = tmp_path / distribution
        info = folder / f"{module}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[pendbench.engines]\n{name} = {module}:Made\n")
        (folder / f"{module}.py").write_text(textwrap.dedent(code))
        monkeypatch.syspath_prepend(folder)
        monkeypatch.delitem(sys.modules, module, raising=False)

    return install


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})
    return registry.register


def refusal(name: str) -> str:
    with pytest.raises(MissingEngineError) as caught:
        engine(name)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize("name", ["analytic", "mujoco", "pymunk"])
def test_bundled_engines_are_found(name):
    assert name in engine_names()
    assert engine(name).name == name


def test_pyproject_says_the_same_as_the_table():
    project = tomllib.loads(Path(__file__).parents[2].joinpath("pyproject.toml").read_text())["project"]
    declared = project["entry-points"]["pendbench.engines"]
    assert declared == {name: target for name, (target, _) in registry._BUNDLED.items()}
    needed = " ".join([project["name"], *project["dependencies"]])
    assert all(package in needed for _, package in registry._BUNDLED.values())


def test_no_engine_is_loaded_before_it_is_asked_for():
    code = """
        import sys
        import pendbench.engines.registry as registry
        assert "mujoco" in registry.engine_names()
        assert not {"mujoco", "pymunk", "numba", "scipy"} & set(sys.modules), "loaded too early"
        registry.engine("pymunk")
        assert "pymunk" in sys.modules
        assert "mujoco" not in sys.modules
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=True)


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(InputError, match=r"unknown engine 'mujco'; did you mean 'mujoco'\? allowed: analytic, "):
        engine("mujco")
    with pytest.raises(InputError, match="unknown engine '3'"):
        engine(3)
    with pytest.raises(InputError, match="allowed:") as caught:
        engine("a\nb" * 1000)
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 300


def test_a_missing_library_is_a_message_with_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)  # importing it now fails as if it were not there
    for module in ("pendbench.engines.mujoco.adapter", "pendbench.engines.mujoco.mjcf"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    assert "pip install --upgrade mujoco-core" in refusal("mujoco")
    assert "mujoco" in engine_names()
    assert engine("pymunk").name == "pymunk"


def test_a_package_can_add_an_engine(package):
    assert "outside" not in engine_names()
    package(GOOD)
    assert "outside" in engine_names()
    assert engine("outside").version() == "1"


def test_a_package_cannot_take_a_bundled_name(package):
    package("raise RuntimeError('loaded')", name="mujoco")
    assert engine("mujoco").name == "mujoco"


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import a_library_that_is_not_there", "cannot be loaded"),
        ("raise RuntimeError('first line\\nsecond line')", "is broken (RuntimeError: first line)"),
        ("Other = 1", "is broken (AttributeError"),
        ("Made = 5", "is broken (TypeError"),
        ("Made = dict", "is not an engine (it has no name)"),
        (GOOD.replace("def refuses", "def accepts"), "is not an engine (it has no refuses())"),
        (GOOD.replace('{"rk4": Method(order=4)}', '["rk4"]'), "is not an engine (its methods"),
        (GOOD.replace('name = "outside"', 'name = "inside"'), "calls itself 'inside'"),
    ],
)
def test_a_broken_package_is_one_line_and_harms_no_other(package, code, said):
    package(code)
    message = refusal("outside")
    assert said in message
    assert message.startswith("engine 'outside' ")
    assert "pip install --upgrade pendbench-outside" in message
    assert "outside" in engine_names()
    assert engine("pymunk").name == "pymunk"


def test_two_packages_that_offer_one_name_are_told_apart(package):
    package(GOOD)
    package(GOOD, distribution="pendbench-rival")
    assert "is offered by pendbench-outside and by pendbench-rival; uninstall one" in refusal("outside")


def test_an_engine_can_be_registered_in_the_process(registered):
    made = AnalyticEngine()
    made.name = "ours"
    registered("ours", lambda: made)
    assert engine("ours") is made
    registered("mine", dict)
    assert "mine" in engine_names()
    assert refusal("mine") == "engine 'mine' is not an engine (it has no name)"


def test_the_name_of_a_bundled_engine_is_not_to_be_had(registered):
    with pytest.raises(InputError, match="'mujoco' comes with pendbench; allowed: another name"):
        registered("mujoco", AnalyticEngine)
    assert engine("analytic").name == "analytic"


def test_the_packages_that_an_engine_came_in_are_known():
    assert registry.packages("mujoco") == ("mujoco-core", "mujoco")
    assert registry.packages("pymunk") == ("pymunk",)
    assert registry.packages("box2d") == ("pyb2d3",)  # what its extra wants
    for name in ("analytic", "xpbd"):
        with pytest.raises(InputError, match="comes with pendbench; allowed: an engine that has releases of its own"):
            registry.packages(name)
