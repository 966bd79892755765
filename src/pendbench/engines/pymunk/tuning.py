"""The settings of `tuned`: how many iterations a chain's joints want, and how fast their errors may be corrected.

pymunk finds the impulses in the joints by Gauss and Seidel's iteration, from those of the step before. What an
iteration leaves of an error follows from the masses: in a straight chain, the worst, the impulses obey a tridiagonal
system in the masses' inverses. Equal links want n^2 / 3 iterations, and a tip of R times the other masses about n R.

A step corrects a share c of the joints' errors in position, and leaves a share q of those in the impulses. One such
error (gap x over a step, velocity v, impulse d yet to be found) goes from step to step as

    x' = x + v,    s = v + d + c x',    v' = q s - c x',    d' = d - (1 - q) s,

which decays while c < (1 - q) / q: with a full correction, c = 1, while q < 1/2. Beyond that each step adds energy, be
it as fine as may be. About (1 - q) / 3 decays fastest where q is near 1. Errors of the rods' lengths grow like 1 / c.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray, all_finite
from pendbench.base.faults import Fault
from pendbench.engines.protocol import State
from pendbench.physics import acting
from pendbench.scene.scene import Scene

MOST_ITERATIONS: Final = 100_000
#: What the iterations of a step may leave of an error where c is 1, and with 10 more they leave less: 0.44.
LEFT: Final = math.exp(-(math.pi**2) / 12.0)
#: The most iterations where the masses want more than equal links would.
AFFORDED: Final = 1000

_PYMUNK_BIAS: Final = 0.9**60  # its own: what is left of an error after a second
_LEAST_BIAS: Final = 1e-300  # 0 would mean a full correction
#: A joint that is open by so much of its rod's length is no joint.
_TORN: Final = 0.5
_ROUNDING: Final = 1e-9


class Tuning(NamedTuple):
    """iterations of each step, the `error_bias` of the joints, and what these mean: the shares c and q of above."""

    iterations: int
    error_bias: float
    corrected: float
    left: float


def tuning(masses: FloatArray, dt: float, iterations: float | None = None) -> Tuning:
    """For a chain of these masses (n,) kg in steps of dt s, with as many iterations as are given or as it needs."""
    factor = left_by_an_iteration(masses)
    chosen = needed_iterations(factor, len(masses)) if iterations is None else int(iterations)
    left = factor**chosen
    if left <= 0.45:
        return Tuning(chosen, 0.0, 1.0, left)
    wanted = math.exp(max(math.log1p(-(1.0 - left) / 3.0) / dt, math.log(_LEAST_BIAS)))
    bias = min(wanted, _PYMUNK_BIAS)
    return Tuning(chosen, bias, -math.expm1(math.log(bias) * dt), left)


def needed_iterations(factor: float, n: int) -> int:
    """Enough to leave less than `LEFT`, where one leaves `factor`, but no more than are afforded.

    Measured with pymunk 7.3.1: chains of 1 m of equal links, released from horizontal and moving in an arc, steps of 1
    and 0.1 ms, 0.3 to 1.5 s. The error was within 1 % of its limit from 3 iterations (n = 2), 13 (5), 44 (10), 133
    (20), 656 (50) and 2623 (100) on. (Where the chain had whipped and the error was percents, 1 % took up to three
    times as many.)
    """
    equal = 10 + math.ceil(n**2 / 3)
    most = min(max(AFFORDED, equal), MOST_ITERATIONS)
    if factor <= 0.0:
        return min(10, most)
    if factor >= 1.0:
        return most
    return min(10 + math.ceil(math.log(LEFT) / math.log(factor)), most)


def left_by_an_iteration(masses: FloatArray) -> float:
    """What an iteration leaves of the slowest error in the impulses of a straight chain of these masses (n,) kg.

    The square of the largest eigenvalue of Jacobi's iteration: Saad, Iterative Methods for Sparse Linear Systems (2nd
    ed. 2003), section 4.2.4. x is above all eigenvalues while the pivots of x - J are positive; x = 1 - y is sought
    in y, of which no digit is lost.
    """
    inverse = masses.min() / masses
    diagonal = inverse + np.concatenate([[0.0], inverse[:-1]])
    squares = inverse[:-1] * inverse[:-1] / diagonal[:-1] / diagonal[1:]
    low, high = 1e-16, 1.0
    for _ in range(3):
        y = np.geomspace(low, high, 257)
        above = _is_above(squares, 1.0 - y)
        if not above[0]:
            return 1.0
        last = int(np.flatnonzero(above)[-1])
        low, high = y[last], y[min(last + 1, 256)]
    return float((1.0 - low) ** 2)


def _is_above(squares: FloatArray, x: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether each x (k,) is above all eigenvalues of J, the squares of whose off-diagonal are (n - 1,)."""
    pivot, above = x.copy(), x >= 0.0
    with np.errstate(all="ignore"):
        for square in squares.tolist():
            pivot = x - square / pivot
            above &= pivot > 0.0
    return above


class Joints:
    """What is wrong with a run, from its states: not finite, torn, or, of a tuned run, not converged.

    Each step along a tangent stretches a rod by half of the square of what it turned, of which the correction leaves
    1 / c. Where the iteration converges, joints are open by at most 1.2 times that (measured over the bundled scenes
    and random chains); where it does not, by 2 to 160 times when the energy begins to grow. The impulses of the first
    steps begin at nothing, and that opens the joints too: by the recursion above, to q / (1 - q)^2 falls of one step.
    """

    def __init__(self, scene: Scene, dt: float, tuned: Tuning | None) -> None:
        self._tuned, self._dt, self._turned = tuned, dt, 0.0
        self._first = 0.0 if tuned is None else _fall(scene) * dt**2 * tuned.left / max(1.0 - tuned.left, 1e-100) ** 2

    def fault(self, state: State) -> Fault | None:
        """Of the state that a run has come to; the fastest turning so far is remembered."""
        if not all_finite(state.theta, state.omega):
            return Fault("not finite", "a position or a velocity is not finite")
        if state.gap > _TORN:
            return Fault("torn", f"a joint is open by {state.gap:.3g} of its rod's length")
        if self._tuned is None:
            return None
        self._turned = max(self._turned, self._dt * float(np.abs(state.omega).max()))
        allowed = 1.5 * self._turned**2 / self._tuned.corrected + self._first + _ROUNDING
        if state.gap > allowed:
            few = f"{self._tuned.iterations} iterations are too few"
            return Fault("not converged", f"{few}: a joint is open by {state.gap:.3g} of its rod's length")
        return None


def _fall(scene: Scene) -> float:
    """How a mass accelerates at the start that nothing holds, over the shortest rod, 1/s^2."""
    pull = float(np.hypot(*acting.pivot_acceleration(scene, 0.0)))
    forces = acting.mass_forces(scene, 0.0, scene.angles, scene.rates)
    push = float((np.hypot(*forces.T) / (scene.masses + acting.links(scene).mass)).max())
    return (pull + push) / float(scene.lengths.min())
