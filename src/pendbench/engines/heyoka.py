"""heyoka as an engine: Taylor's method on the O(n) recursion, differentiated and compiled for each chain.

heyoka takes its step from the last two terms of the series of its state. For a chain released at rest from the
horizontal, two of every four orders in a row are zero in all angles and rates. So at orders 8, 12, 16 and 20 (its
default tolerance) the first step has no bound: double.toml is off by 4e-3 after 1 s, without a word. That is why the
direction of the first rod is part of the state: its sine and cosine have terms where the others have none.

Measured with heyoka 7.13.2, n = 2, 10, 50 and 100, orders 8 to 20. A step in machine code that is unrolled over links
and orders takes half the time of one in compact code. fast_math saves 5 to 25 % of the unrolled and costs the compact
up to 40 %; no error shows its rounding. The dense form of n = 2 took 20 to 30 % longer, (E17) to (E19) written out 30
to 140 %. All directions as state, vectorisation (slp_vectorize) and optimisation beyond level 1 gained nothing;
high_accuracy cost 5 to 15 % and gained no digit.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any, Final

import heyoka as hy

from pendbench.base.faults import Fault
from pendbench.effects import names as effect_names
from pendbench.engines.protocol import AdaptiveSimulation, Mapped, Method, Setting, State
from pendbench.scene.links import LINKS
from pendbench.scene.scene import Scene

_TOLERANCE: Final = sys.float_info.epsilon  # heyoka's own default


def taylor_order(tolerance: float) -> int:
    """The order that heyoka chooses: Jorba and Zou, Experimental Mathematics 14 (2005), section 3."""
    return max(2, math.ceil(1.0 - 0.5 * math.log(tolerance)))


_SETTINGS: Final = {
    "tolerance": Setting(_TOLERANCE, _TOLERANCE, 1e-2, note="of a step, relative to the largest of the state or to 1"),
    "most_steps": Setting(1e8, 1, 1e15, integer=True, note="more steps end the run with status 'work limit'"),
}
_NOTE: Final = "Taylor series of order ceil(1 - ln(tolerance) / 2); the order claimed is that of the default tolerance"
_METHODS: Final = {"taylor": Method(taylor_order(_TOLERANCE), adaptive=True, settings=_SETTINGS, note=_NOTE)}
_ALONE: Final = Mapped("the adapter writes the equations of motion under gravity alone", refused=True)
_EFFECTS: Final = {**dict.fromkeys((*effect_names(), LINKS), _ALONE), "gravity": Mapped("in the equations of motion")}
_MOST_LINKS: Final = 200  # 15 s to compile, on a busy machine
_STEPS_A_CALL: Final = 200  # heyoka does not hear an interrupt
_MOST_UNROLLED: Final = 11_000  # n (order^2 + n): unrolled code takes about a millisecond of compiling for each


class _Chain:
    """A chain in expressions of heyoka. Lengths are measured in first rods: equal ones then cost nothing."""

    def __init__(self, scene: Scene) -> None:
        self._theta, self._omega = ([hy.expression(f"{a}_{i}") for i in range(scene.n)] for a in ("theta", "omega"))
        self._cosine, self._sine = hy.expression("cosine"), hy.expression("sine")  # of the first rod's angle
        self._lengths = [float(length / scene.lengths[0]) for length in scene.lengths]
        self._ratios = [float(m / outer) for m, outer in zip(scene.masses, scene.masses[1:], strict=False)]
        self._gravity = (scene.effects.gravity or 0.0) / float(scene.lengths[0])
        first = float(scene.angles[0])
        direction = [math.cos(first), math.sin(first)] if self._gravity else []
        self.start = [*scene.angles.tolist(), *scene.rates.tolist(), *direction]

    def equations(self) -> list[tuple[Any, Any]]:
        """Each variable with its derivative, in the order of `start`."""
        turning = self._omega[0]
        direction = [(self._cosine, -self._sine * turning), (self._sine, self._cosine * turning)]
        rates = zip(self._omega, self._accelerations(), strict=True)
        return [*zip(self._theta, self._omega, strict=True), *rates, *(direction if self._gravity else [])]

    def _inwards(self) -> tuple[list[tuple[Any, Any, Any]], Any]:
        """For each joint: own, passed and sine, with T_{i+1} = own + passed T_i; and T_1. T_i is in units of m_i l_1.

        equations.md (E17) in looseness, m_i / alpha_i, and motion, beta_i / (alpha_i l_1): there are ten products of
        series for each joint, where (E17) to (E19) as they stand have fifteen, and still no difference to lose digits.
        """
        joints = []
        looseness, motion = hy.expression(1.0), self._lengths[-1] * self._omega[-1] ** 2
        for i in reversed(range(len(self._ratios))):
            bend = self._theta[i + 1] - self._theta[i]
            cosine, sine = hy.cos(bend), hy.sin(bend)
            outer = self._ratios[i] * looseness
            own, passed = motion / (1.0 + outer), cosine / (1.0 + outer)
            joints.append((own, passed, sine))
            motion = self._lengths[i] * self._omega[i] ** 2 + cosine * own
            looseness = (outer + sine**2) / (1.0 + outer)
        return joints[::-1], (motion + self._gravity * self._cosine) / looseness

    def _accelerations(self) -> list[Any]:
        joints, tension = self._inwards()
        found, start = [], self._gravity * self._sine  # how the inner end of the rod accelerates across it
        for (own, passed, sine), ratio, length in zip(joints, self._ratios, self._lengths, strict=False):
            following = own + passed * tension
            found.append((sine * following - start) / length)
            start, tension = sine * tension, ratio * following
        return [*found, -start / self._lengths[-1]]


class _Run:
    """One chain in heyoka."""

    def __init__(self, scene: Scene, tolerance: float, most_steps: int) -> None:
        unrolled = scene.n * (taylor_order(tolerance) ** 2 + scene.n) <= _MOST_UNROLLED
        code = {"fast_math": True, "opt_level": 1} if unrolled else {"compact_mode": True}
        chain = _Chain(scene)
        self._integrator = hy.taylor_adaptive(chain.equations(), chain.start, tol=tolerance, **code)
        self._n, self._left, self._goal, self._outcome = scene.n, most_steps, 0.0, hy.taylor_outcome.time_limit

    def advance_to(self, time: float) -> int:
        if self._left == 0:  # heyoka would take that for no limit
            self._outcome = hy.taylor_outcome.step_limit
        if self._outcome != hy.taylor_outcome.time_limit:  # which is how it calls having arrived
            return 0
        self._goal = time
        before = self._left
        while self._left > 0:
            most = min(self._left, _STEPS_A_CALL)
            self._outcome, _, _, taken, *_ = self._integrator.propagate_until(time, max_steps=most)
            self._left -= taken
            if self._outcome != hy.taylor_outcome.step_limit:
                break
        return int(before - self._left)

    def state(self) -> State:
        theta, omega = self._integrator.state[: 2 * self._n].copy().reshape(2, self._n)
        return State(theta, omega)

    def health(self) -> Fault | None:
        if self._outcome == hy.taylor_outcome.step_limit:
            return Fault("work limit", f"more steps than allowed at t = {self._integrator.time:.6g} s")
        if self._outcome != hy.taylor_outcome.time_limit:
            return Fault("not finite", f"an angle, a rate or a step is not, on the way to t = {self._goal:.6g} s")
        return None


class HeyokaEngine:
    """heyoka, in double precision."""

    name = "heyoka"
    methods: Mapping[str, Method] = _METHODS
    effects: Mapping[str, Mapped] = _EFFECTS

    def version(self) -> str:
        """The version of heyoka itself."""
        return str(hy.__version__)

    def refuses(self, scene: Scene) -> str | None:
        """Chains that take too long to compile."""
        if scene.n > _MOST_LINKS:
            return f"{scene.n} links; compiling the series of more than {_MOST_LINKS} takes too long"
        return None

    def build(self, scene: Scene, method: str, dt: float | None, **settings: float) -> AdaptiveSimulation:  # noqa: ARG002
        """A run at time 0. Compiles the equations, unless heyoka has them in its cache on disk."""
        chosen = self.methods[method].with_defaults(settings)
        return _Run(scene, chosen["tolerance"], int(chosen["most_steps"]))
