"""How far can you trust a physics engine? Chains of pendulums against an analytic reference.

The names below are the public face. Each is loaded when first used, so importing the package loads no engine. No
module has the name of a public function: importing the one would hide the other.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pendbench.base.notebook import show_with

__version__ = "0.1.0"

if TYPE_CHECKING:
    from pendbench.base.errors import InputError
    from pendbench.commands.comparing import compare
    from pendbench.commands.gating import gate
    from pendbench.commands.judge import judge
    from pendbench.commands.run import run_study
    from pendbench.commands.showing import show
    from pendbench.effects import Effects
    from pendbench.engines.analytic.ensemble import Ensemble, first_flips, simulate_ensemble
    from pendbench.engines.conformance import check_engine
    from pendbench.engines.recording import simulate
    from pendbench.physics.energy import energy
    from pendbench.scene.run_file import load_run
    from pendbench.scene.scene import Scene, load_scene
    from pendbench.scene.trajectory import Trajectory
    from pendbench.truth.proof.proof import prove
    from pendbench.truth.reference import reference

_HOMES = {
    "Effects": "pendbench.effects",
    "Ensemble": "pendbench.engines.analytic.ensemble",
    "InputError": "pendbench.base.errors",
    "Scene": "pendbench.scene.scene",
    "Trajectory": "pendbench.scene.trajectory",
    "check_engine": "pendbench.engines.conformance",
    "compare": "pendbench.commands.comparing",
    "energy": "pendbench.physics.energy",
    "first_flips": "pendbench.engines.analytic.ensemble",
    "gate": "pendbench.commands.gating",
    "judge": "pendbench.commands.judge",
    "load_run": "pendbench.scene.run_file",
    "load_scene": "pendbench.scene.scene",
    "prove": "pendbench.truth.proof.proof",
    "reference": "pendbench.truth.reference",
    "run_study": "pendbench.commands.run",
    "show": "pendbench.commands.showing",
    "simulate": "pendbench.engines.recording",
    "simulate_ensemble": "pendbench.engines.analytic.ensemble",
}

__all__ = [
    "Effects",
    "Ensemble",
    "InputError",
    "Scene",
    "Trajectory",
    "check_engine",
    "compare",
    "energy",
    "first_flips",
    "gate",
    "judge",
    "load_run",
    "load_scene",
    "prove",
    "reference",
    "run_study",
    "show",
    "simulate",
    "simulate_ensemble",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


# A run of a low room shows itself by what is built on it: it is told here, where both are known.
show_with(lambda run: __getattr__("show")(run)._repr_html_())


def __dir__() -> list[str]:
    return sorted((*__all__, "__version__"))
