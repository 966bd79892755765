"""Which kernel does what for which system: what solvers ask of a system (`solvers.problem`), and who answers.

Whoever wants a solver to advance a chain gets the chain's system here, and with it the answers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined, specialise
from pendbench.physics.acting import check_plain
from pendbench.physics.kernels import both_ends, canonical, ensemble, massive, massless, rotors, series, single
from pendbench.physics.kernels.ensemble import EnsembleSystem, ensemble_system_of
from pendbench.physics.kernels.series import SeriesSystem, chain_series_of
from pendbench.physics.kernels.single import SingleSystem, single_system_of
from pendbench.physics.kernels.system import LinkSystem, RotorSystem, System, system_of
from pendbench.scene.scene import Scene
from pendbench.solvers import problem
from pendbench.solvers.copying import copy

__all__ = ["TABLE", "ensemble_system_of", "momenta_of", "rates_of", "series_system_of", "system_of"]


@inlined
def _write_derivative(system: Any, t: float, y: FloatArray, dy: FloatArray) -> None:
    """Write the rates and their accelerations (2 n,) at time t s and y = theta, omega (2 n,) into dy."""
    n = len(y) // 2
    copy(y[n:], dy)
    problem.acceleration(system, t, y[:n], y[n:], dy[n:])


def _pushed(kinds: Mapping[str, Any]) -> bool:
    """Whether anything but weight acts on the masses of a system whose fields are of these types."""
    return len(kinds["joints"]) + len(kinds["drags"]) > 0


TABLE: Final[Mapping[type, Mapping[Callable[..., None], Callable[..., None]]]] = {
    System: {
        problem.derivative: _write_derivative,
        problem.momentum: canonical.write_momenta,
        problem.velocity: canonical.write_rates,
        problem.generalized_force: canonical.write_forces,
    },
    LinkSystem: {
        problem.derivative: _write_derivative,
        problem.acceleration: massive.write_accelerations,
        problem.momentum: canonical.write_massive_momenta,
        problem.velocity: massive.write_rates,
        problem.generalized_force: canonical.write_forces,
    },
    RotorSystem: {
        problem.derivative: _write_derivative,
        problem.acceleration: rotors.write_accelerations,
        problem.momentum: rotors.write_momenta,
        problem.velocity: rotors.write_rates,
        problem.generalized_force: rotors.write_forces,
    },
    EnsembleSystem: {problem.ensemble_derivatives: ensemble.write_derivatives},
    SeriesSystem: {problem.rate_series: series.write_rate_series},
    SingleSystem: {problem.rate_series: single.write_rate_series},
}

for _system, _kernels in TABLE.items():
    for _asked, _kernel in _kernels.items():
        specialise(_asked, _system, _kernel)
specialise(problem.acceleration, System, massless.write_accelerations, where=_pushed)
specialise(problem.acceleration, System, both_ends.write_accelerations, where=lambda kinds: not _pushed(kinds))


def series_system_of(scene: Scene, order: int) -> SeriesSystem | SingleSystem:
    """The scene's chain, with room for series of that order. Raises InputError where more than gravity acts."""
    check_plain(scene, "the Taylor series")
    return single_system_of(scene, order) if scene.n == 1 else chain_series_of(scene, order)


@compiled
def momenta_of(system: Any, theta: FloatArray, omega: FloatArray, out: FloatArray) -> None:
    """Write the momenta (n,) kg m^2/s of any system into `out`."""
    problem.momentum(system, theta, omega, out)


@compiled
def rates_of(system: Any, theta: FloatArray, momenta: FloatArray, out: FloatArray) -> None:
    """Write the rates (n,) rad/s of any system into `out`."""
    problem.velocity(system, theta, momenta, out)
