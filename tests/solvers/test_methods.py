"""A method with a fixed step is one file: it is found, and does what its form asks."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pendbench.solvers.methods import Form, fixed_step_methods

HEUN = '''
"""Heun's method: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, p. 135."""
import numpy as np
from pendbench.solvers.explicit import Tableau, runge_kutta_method
from pendbench.solvers.methods import add

HEUN = Tableau(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, 0.5]), np.array([0.0, 1.0]), order=2)
add(runge_kutta_method("heun", HEUN, note="two stages"))
'''
USE = """
import numpy as np
import pendbench as pb
from pendbench.engines.registry import engine
print(engine("analytic").methods["heun"].order, engine("analytic").methods["heun"].note)
truth = pb.simulate("double", "analytic", "rk4", 1e-3, [0.1]).theta
errors = [np.abs(pb.simulate("double", "analytic", "heun", dt, [0.1]).theta - truth).max() for dt in (2e-3, 1e-3)]
assert abs(np.log2(errors[0] / errors[1]) - 2) < 0.1, errors
"""


def test_one_file_adds_a_method(tmp_path):
    source = Path(__file__).parents[2]
    for part in ("src", "models"):
        shutil.copytree(source / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    (tmp_path / "src/pendbench/solvers/heun.py").write_text(HEUN)
    paths = os.pathsep.join([str(tmp_path / "src"), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", USE],
        env={**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "2 two stages\n"


@pytest.mark.parametrize("name", fixed_step_methods())
def test_state_holds_what_its_form_says_and_is_a_copy(name):
    method = fixed_step_methods()[name]
    start = [np.full(3, float(k)) for k in range(3 if method.form is Form.MOMENTA else 2)]
    state = method.begin(*start)
    held = {Form.RATES: ("q", "v"), Form.MOMENTA: ("q", "p"), Form.RODS: ("q", "v")}[method.form]
    for given, kept in zip(start, held, strict=False):
        np.testing.assert_array_equal(getattr(state, kept), given)
        assert not np.shares_memory(getattr(state, kept), given)
