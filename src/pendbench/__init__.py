"""How far can you trust a physics engine? Chains of pendulums against an analytic reference.

The names below are the public face. Each is loaded when first used, so importing the package loads no engine. No
module has the name of a public function: importing the one would hide the other.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from pendbench.engines.conformance import check_engine
    from pendbench.ensemble import Ensemble, first_flips, simulate_ensemble
    from pendbench.errors import InputError
    from pendbench.physics.energy import energy
    from pendbench.recording import simulate
    from pendbench.scene import Scene, load_scene
    from pendbench.study.api import run_study
    from pendbench.trajectory import Trajectory
    from pendbench.truth import reference

_HOMES = {
    "Ensemble": "pendbench.ensemble",
    "InputError": "pendbench.errors",
    "Scene": "pendbench.scene",
    "Trajectory": "pendbench.trajectory",
    "check_engine": "pendbench.engines.conformance",
    "energy": "pendbench.physics.energy",
    "first_flips": "pendbench.ensemble",
    "load_scene": "pendbench.scene",
    "reference": "pendbench.truth",
    "run_study": "pendbench.study.api",
    "simulate": "pendbench.recording",
    "simulate_ensemble": "pendbench.ensemble",
}

__all__ = [
    "Ensemble",
    "InputError",
    "Scene",
    "Trajectory",
    "check_engine",
    "energy",
    "first_flips",
    "load_scene",
    "reference",
    "run_study",
    "simulate",
    "simulate_ensemble",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
