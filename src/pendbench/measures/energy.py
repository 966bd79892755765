"""What becomes of a run's energy: the one measure of it, for every study.

Where all that acts has a potential, the energy should stay what it was. Where something damps or drives, the energy
less the work of that should. No study has to know which of the two its scene is. Source: docs/measuring.md.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.measures.drift import Drift, drift
from pendbench.physics.acting import is_shaken, power
from pendbench.physics.energy import energy, energy_scale
from pendbench.scene.scene import Scene
from pendbench.scene.trajectory import Trajectory

# What acts without storing energy, by the law that it has and the one that it would have if it did.
_WORKS: Final = (("joint_torque", "joint_potential"), ("pivot_acceleration", "mass_potential"), ("drag", "potential"))

_FEWEST: Final = 4  # samples that tell how well the work is known
_GAIN: Final = 15.0  # by which twice the samples bring a rule of order 4 nearer, less one
_WILD: Final = 1e150  # J or W, beyond which products overflow
_MOST_SAMPLES: Final = 20_000
_MOST_NUMBERS: Final = 2_000_000  # angles of all samples together


def conserves_energy(scene: Scene) -> bool:
    """Whether all that acts has a potential, as gravity and springs have, and damping, air and drives have not."""
    return not any(_works(term) for term in scene.terms.values())


def _works(term: Any) -> bool:
    return any(hasattr(term, law) and not hasattr(term, potential) for law, potential in _WORKS)


def is_driven(scene: Scene) -> bool:
    """Whether what acts depends on the time."""
    return is_shaken(scene) or any(hasattr(term, "drive") for term in scene.terms.values())


@dataclass(frozen=True, eq=False)
class Balance:
    """What a run does to its energy, at its samples t (k,) s.

    kept (k,) J: the energy less the work of what damps and drives, which the equations of motion leave as it was; inf
    from where numbers are too large to be integrated. scale: J, what deviations are measured in: equations.md (E21), or
    the largest work where that is larger. floor (k,): how well the work up to each sample is known, in units of the
    scale: a deviation below it is not told from 0. It is 0 where nothing works, inf where there are too few samples.
    """

    t: FloatArray
    kept: FloatArray
    scale: float
    floor: FloatArray
    works: bool = False

    @property
    def error(self) -> FloatArray:
        """How far `kept` is from its first value, (k,), in units of the scale (J where that is 0)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray((self.kept - self.kept[:1]) / (self.scale or 1.0))

    @property
    def excess(self) -> FloatArray:
        """By how much the error, without its sign, is above its floor, (k,): what is astray for certain."""
        error = np.abs(self.error)
        return error - np.minimum(self.floor, error) if self.works else error

    @property
    def known_to(self) -> float:
        """The floor of the whole run; nan where nothing works, and the energy itself is measured."""
        return float(self.floor.max()) if self.works and len(self.t) else math.nan

    def drift(self, part: Any = slice(None)) -> Drift:
        """How it strays in a part of the run: a slice or a mask of samples."""
        return drift(self.t[part], self.kept[part], self.scale)

    def at(self, chosen: Any) -> Balance:
        """The same at some of the samples only."""
        return dataclasses.replace(self, t=self.t[chosen], kept=self.kept[chosen], floor=self.floor[chosen])


def energy_balance(scene: Scene, run: Trajectory) -> Balance:
    """What a run does to its energy.

    The work is the integral of the effects' power along the run itself, by the cubic spline through its samples: good
    to order 4 in their distance, so that they should be dense (`times_to_balance`). Its floor is what half of them
    would have given, over the 15 by which a rule of order 4 gains.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a run that blew up has an infinite energy
        values, scale = energy(scene, run.theta, run.omega), energy_scale(scene)
        if conserves_energy(scene):
            return Balance(run.t, values, scale, np.zeros(len(run.t)))
        given = power(scene, run.t, run.theta, run.omega)
    return balance_of(run.t, values, given, scale)


def balance_against(scene: Scene, run: Trajectory, truth: Trajectory) -> Balance:
    """What a run does to its energy beyond what the truth does at the same times, where its work cannot be integrated.

    Of a run on the truth it is the same: their works differ by as much as the run is off.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        values, right = energy(scene, run.theta, run.omega), energy(scene, truth.theta, truth.omega)
    change = right - right[:1]
    scale = max(energy_scale(scene), float(np.abs(change).max(initial=0.0)))
    return Balance(run.t, values - change, scale, np.zeros(len(run.t)))


def balance_of(t: FloatArray, values: FloatArray, given: FloatArray, scale: float) -> Balance:
    """The balance of energies `values` (k,) J and powers `given` (k,) W at times t (k,) s; scale: J, of the scene."""
    wild = np.flatnonzero(~((np.abs(values) < _WILD) & (np.abs(given) < _WILD)))
    whole = int(wild[0]) if wild.size else len(t)
    kept, floor = np.full(len(t), np.inf), np.zeros(len(t))
    if whole:
        work = _integral(t[:whole], given[:whole])
        scale = max(scale, float(np.abs(work).max()))
        kept[:whole] = values[:whole] - work
        floor[:whole] = _how_well_known(t[:whole], given[:whole], work) / (scale or 1.0)
    return Balance(t, kept, scale, floor, works=True)


def _integral(t: FloatArray, values: FloatArray) -> FloatArray:
    """The integral (k,) of values (k,) from the first time, by the cubic spline through them: of order 4."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(t, values).antiderivative()(t)) if len(t) > 1 else np.zeros(len(t))


def _how_well_known(t: FloatArray, values: FloatArray, integral: FloatArray) -> FloatArray:
    """How far the integral (k,) may be off up to each sample."""
    if len(t) < _FEWEST:
        return np.append(0.0, np.full(len(t) - 1, np.inf))
    apart = np.maximum.accumulate(np.abs(integral[::2] - _integral(t[::2], values[::2])) / _GAIN)
    return np.append(np.repeat(apart, 2)[1:], apart[-1])[: len(t)]  # each second sample's is that of the next


def times_to_balance(scene: Scene, dt: float | None, times: FloatArray) -> FloatArray:
    """The times (j,) s at which a run with steps `dt` (s) is sampled, that is asked for at `times` (k,) s.

    These alone where energy is conserved. Where its work has to be integrated, every step beside them, or as many as
    memory allows; as many for a method that chooses its steps.
    """
    if conserves_energy(scene) or len(times) < 2:
        return times
    most = max(1000, min(_MOST_SAMPLES, _MOST_NUMBERS // scene.n))
    if dt is None:
        parts = -(-most // (len(times) - 1))
        between = np.linspace(times[:-1], times[1:], parts, endpoint=False).T.ravel()
        return np.append(between, times[-1])
    counts = np.rint(times / dt)
    stride = max(1, -(-int(counts[-1]) // most))
    return np.asarray(np.union1d(np.arange(0, counts[-1], stride), counts) * dt)


class Meter:
    """The balance of a run as it goes on, from the scene's start; what needs no past keeps none.

    lost, risen: by how much the energy itself is below its first value, and at most was above any value before, in
    units of its scale; nan where it is not finite.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._works, self._scale = scene, not conserves_energy(scene), energy_scale(scene)
        self._first = float(energy(scene, scene.angles, scene.rates))
        self._t, self._values, self._given = [0.0], [self._first], [self._power(0.0, scene.angles, scene.rates)]
        self.lost, self.risen, self._lowest = 0.0, 0.0, self._first

    def add(self, t: float, theta: FloatArray, omega: FloatArray) -> float:
        """By how much the energy is astray for certain at t, s, in units of its scale, with the state there."""
        with np.errstate(over="ignore", invalid="ignore"):
            value = float(energy(self._scene, theta, omega))
            self._note(value)
            if not self._works:
                return abs(value - self._first) / (self._scale or 1.0)
            self._t.append(t)
            self._values.append(value)
            self._given.append(self._power(t, theta, omega))
        past = np.array(self._t), np.array(self._values), np.array(self._given)
        return float(balance_of(*past, self._scale).excess[-1])

    def _note(self, value: float) -> None:
        scale = self._scale or 1.0
        self.lost = (self._first - value) / scale if math.isfinite(value) else math.nan
        self._lowest = min(self._lowest, value)
        rise = (value - self._lowest) / scale
        self.risen = max(self.risen, rise) if math.isfinite(value + self.risen) else math.nan

    def _power(self, t: float, theta: FloatArray, omega: FloatArray) -> float:
        return float(power(self._scene, t, theta, omega)) if self._works else 0.0


def with_energy_checked(run: Trajectory, balance: Balance) -> Trajectory:
    """The run, with the status "energy lost" if it was ok and its energy strayed by more than the scale, for certain.

    All samples stay. A chain at rest that nothing pulls at is exempt: it has no energy to lose.
    """
    if run.status != "ok" or not balance.scale > 0.0:
        return run
    lost = np.flatnonzero(~(balance.excess <= 1.0))
    if not lost.size:
        return run
    first = int(lost[0])
    what = "the balance of its energy" if balance.works else "its energy"
    astray = abs(balance.error[first])
    reason = f"at t = {balance.t[first]:.6g} s {what} is off by {astray:.3g} of the energy scale"
    return dataclasses.replace(run, status="energy lost", reason=reason)
