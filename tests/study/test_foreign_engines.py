"""Somebody else's engine that ends the process which loads it ends no study: it is one line."""

from __future__ import annotations

import pytest

from pendbench.base.errors import InputError
from pendbench.engines.registry import is_foreign
from pendbench.study.plan import load_plan

STUDY = """
title  = "T"
scenes = ["double"]

[[engines]]
name    = "deadly"
methods = ["rk4"]
dt      = [1e-2]
"""


@pytest.fixture
def deadly(tmp_path, monkeypatch):
    """A package whose engine ends its process: as it is imported, or as its version is asked."""
    info = tmp_path / "deadly-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: deadly\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pendbench.engines]\ndeadly = deadly_engine:Deadly\n")
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "code",
    [
        "import os\nos.abort()\n",
        "from pendbench.engines.protocol import Method\nimport os\nclass Deadly:\n    name = 'deadly'\n"
        "    methods = {'rk4': Method(order=4)}\n    def version(self): os.abort()\n"
        "    def refuses(self, scene): return None\n    def build(self, scene, method, dt): raise ValueError\n",
    ],
    ids=["import", "version"],
)
def test_an_engine_that_dies_as_it_is_loaded_is_one_line(deadly, code):
    (deadly / "deadly_engine.py").write_text(code)
    assert is_foreign("deadly")
    with pytest.raises(InputError, match="engine 'deadly' cannot be loaded: crashed, the process died of SIGABRT"):
        load_plan(deadly / "study.toml")


def test_ours_are_not_foreign():
    assert not any(is_foreign(name) for name in ("analytic", "mujoco", "pymunk", "heyoka", "nobody"))
