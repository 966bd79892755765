"""The equations of a scene, to be evaluated with any number of `numbers.py`.

Constants are computed in balls from the scene's floats, which are exact; the formulas are (E6) to (E9), (E36) to (E40),
(E53) and (E55) of docs/equations.md. Two forms: rates as unknowns, and momenta.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pendbench.base.errors import InputError
from pendbench.scene.scene import Scene
from pendbench.truth.proof.numbers import Number, sine_cosine, solve

#: [i][j], j <= i or j < i.
Lower = list[list[Number]]

#: The effects that are known here. What is not is refused: a proof of other equations would prove nothing.
KNOWN = frozenset(
    {
        "gravity",
        "joint_damping",
        "joint_stiffness",
        "joint_rest",
        "joint_torque",
        "air_drag",
        "rod_mass",
        "driven_pivot",
        "drive_torque",
        "armature",
        "links",
    }
)


#: More links take days: a step costs n^3, and there are more of them.
MOST_LINKS = 40


def check_provable(scene: Scene) -> None:
    """Raise `InputError` where a scene has too many links, or an effect that is not analytic or not known here."""
    if scene.n > MOST_LINKS:
        raise InputError(f"scene {scene.name!r} has {scene.n} links; allowed in a proof: up to {MOST_LINKS}")
    unknown = sorted(scene.terms.keys() - KNOWN)
    if unknown:
        raise InputError(
            f"scene {scene.name!r} calls for {unknown[0]}; allowed in a proof: {', '.join(sorted(KNOWN - {'links'}))}"
        )
    drag: Any = scene.terms.get("air_drag")
    if drag is not None and np.any(drag.quadratic):
        raise InputError(
            f"scene {scene.name!r} has quadratic air_drag, which is not smooth where a mass stands still, and a proof "
            "needs smooth equations; allowed: linear drag"
        )


@dataclass(frozen=True)
class Constants:
    """The numbers of a scene's equations, in balls.

    inertia: [i][j], j <= i, kg m^2, what cos(theta_i - theta_j) has before it in C, on the diagonal all there is of
    links; rotors: the same, of what is constant in C. coupling: [i][j], what sin(theta_i - theta_j) has. drag: [i][j]
    of linear drag. weights: kg m, of each rod. All others (n,), in the units of the scene.
    """

    n: int
    inertia: Lower
    rotors: Lower
    drag: Lower
    weights: list[Number]
    pulled: list[Number]
    damping: list[Number]
    stiffness: list[Number]
    rest: list[Number]
    torque: list[Number]
    gravity: Number
    pivot: tuple[Number, Number, Number, Number] | None
    motor: tuple[int, Number, Number, Number] | None


def constants(scene: Scene) -> Constants:
    """Of a scene, to the precision of now. Raises `InputError` where the equations are not analytic."""
    from flint import arb

    check_provable(scene)
    terms: Any = scene.terms
    n = scene.n
    masses, lengths = _balls(scene.masses), _balls(scene.lengths)
    own = _links(scene, lengths)
    lumped = [m + w * c / length for m, (w, c, _), length in zip(masses, own, lengths, strict=True)]
    for i in range(n - 1):
        w, c, _ = own[i + 1]
        lumped[i] += w * (lengths[i + 1] - c) / lengths[i + 1]
    hanging, drag = _outwards(lumped), _outwards(_each(terms, "air_drag", "linear", n))
    inertia = [[hanging[i] * lengths[i] * lengths[j] for j in range(i + 1)] for i in range(n)]
    for i, (w, c, about) in enumerate(own):
        inertia[i][i] += about - w * c * (lengths[i] - c)
    gravity, pivot, motor = terms.get("gravity"), terms.get("driven_pivot"), terms.get("drive_torque")
    joint = int(np.flatnonzero(motor.amplitudes)[0]) if motor else 0
    return Constants(
        n=n,
        inertia=inertia,
        rotors=_rotors(_each(terms, "armature", "rotors", n)),
        drag=[[drag[i] * lengths[i] * lengths[j] for j in range(i + 1)] for i in range(n)],
        weights=[m * length for m, length in zip(hanging, lengths, strict=True)],
        pulled=[d * length for d, length in zip(drag, lengths, strict=True)],
        damping=_each(terms, "joint_damping", "damping", n),
        stiffness=_each(terms, "joint_stiffness", "stiffness", n),
        rest=_each(terms, "joint_stiffness", "rest", n),
        torque=_each(terms, "joint_torque", "torque", n),
        gravity=arb(float(gravity.gravity) if gravity else 0.0),
        pivot=(arb(pivot.x), arb(pivot.y), arb(pivot.frequency), arb(pivot.phase)) if pivot else None,
        motor=(joint, arb(float(motor.amplitudes[joint])), arb(motor.frequency), arb(motor.phase)) if motor else None,
    )


def _balls(values: Any) -> list[Number]:
    from flint import arb

    return [arb(float(value)) for value in values]


def _each(terms: Any, effect: str, numbers: str, n: int) -> list[Number]:
    return _balls(getattr(terms[effect], numbers) if effect in terms else np.zeros(n))


def _links(scene: Scene, lengths: list[Number]) -> list[tuple[Number, Number, Number]]:
    """Mass, centre and inertia of each link beside the point at its end: a rigid link's, or a uniform rod's."""
    if scene.links is not None:
        its = scene.links
        return list(zip(_balls(its.mass), _balls(its.centre), _balls(its.inertia), strict=True))
    rods = _each(scene.terms, "rod_mass", "rods", scene.n)
    return [(rod, length / 2, rod * length * length / 12) for rod, length in zip(rods, lengths, strict=True)]


def _outwards(values: list[Number]) -> list[Number]:
    """Each with all further out."""
    return [sum(values[i + 1 :], values[i]) for i in range(len(values))]


def _rotors(rotors: list[Number]) -> Lower:
    """What rotors in the joints add to C, lower half: (E55)."""
    n = len(rotors)
    lower = [[0 * rotors[0] for _ in range(i + 1)] for i in range(n)]
    for i, rotor in enumerate(rotors):
        lower[i][i] += rotor
        if i > 0:
            lower[i - 1][i - 1] += rotor
            lower[i][i - 1] -= rotor
    return lower


class Rates:
    """The equations with the state x = (theta, omega / scale), 2 n numbers.

    scale: a power of two near the chain's own frequency, 1/s, so that all numbers of the state are about as large.
    """

    name = "angles and rates"

    def __init__(self, scene: Scene) -> None:
        self.constants, self.scale = constants(scene), own_scale(scene)
        self.n = scene.n

    def start(self, scene: Scene) -> list[Number]:
        """The state at the scene's start; exact."""
        return [*_balls(scene.angles), *(rate / self.scale for rate in _balls(scene.rates))]

    def motion(self, state: Sequence[Number]) -> tuple[list[Number], list[Number]]:
        """Angles and rates, rad and rad/s, from a state of balls."""
        return list(state[: self.n]), [w * self.scale for w in state[self.n :]]

    def slope(self, x: Sequence[Number], t: Number, apart: Lower | None = None) -> list[Number]:
        """The state's derivative with respect to time, at t s. apart: what is known better of theta_i - theta_j."""
        omega = [w * self.scale for w in x[self.n :]]
        matrix, right = balance(self.constants, x[: self.n], omega, t, apart)
        return [*omega, *(a * (1 / self.scale) for a in solve(matrix, right))]


class Momenta(Rates):
    """The equations with the state x = (theta, p / scale), where p = C omega: Hamilton's form."""

    name = "angles and momenta"

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        largest = max(float(row[-1].abs_upper()) for row in self.constants.inertia)
        self.unit = self.scale * 2.0 ** round(math.log2(largest))

    def start(self, scene: Scene) -> list[Number]:
        """The state at the scene's start, in balls: where rates are not 0, the momenta are rounded."""
        theta, omega = _balls(scene.angles), _balls(scene.rates)
        matrix, _, _ = _matrix(self.constants, theta)
        whole = [[matrix[max(i, j)][min(i, j)] for j in range(self.n)] for i in range(self.n)]
        momenta = [sum((a * w for a, w in zip(row, omega, strict=True)), 0 * omega[0]) for row in whole]
        return [*theta, *(p / self.unit for p in momenta)]

    def motion(self, state: Sequence[Number]) -> tuple[list[Number], list[Number]]:
        """Angles and rates, rad and rad/s, from a state of balls."""
        theta, momenta = list(state[: self.n]), [p * self.unit for p in state[self.n :]]
        return theta, solve(_matrix(self.constants, theta)[0], momenta)

    def slope(self, x: Sequence[Number], t: Number, apart: Lower | None = None) -> list[Number]:
        """The state's derivative with respect to time, at t s. apart: what is known better of theta_i - theta_j."""
        theta, momenta, c = x[: self.n], [p * self.unit for p in x[self.n :]], self.constants
        matrix, sines, cosines = _matrix(c, theta, apart)
        omega = solve(matrix, momenta)
        right = _forces(c, theta, omega, cosines, t)
        for i in range(self.n):
            for j in range(i):
                pair = c.inertia[i][j] * (sines[i][j] * (omega[i] * omega[j]))
                right[i], right[j] = right[i] - pair, right[j] + pair
        return [*omega, *(force * (1 / self.unit) for force in right)]


def balance(
    c: Constants, theta: Sequence[Number], omega: Sequence[Number], t: Number, apart: Lower | None = None
) -> tuple[Lower, list[Number]]:
    """The lower half of C, and S omega^2 - h + Q, of C theta'' = S omega^2 - h + Q. (E6), (E40)."""
    matrix, sines, cosines = _matrix(c, theta, apart)
    right = _forces(c, theta, omega, cosines, t)
    squares = [w * w for w in omega]
    for i in range(c.n):
        for j in range(i):
            right[i] = right[i] - c.inertia[i][j] * (sines[i][j] * squares[j])
            right[j] = right[j] + c.inertia[i][j] * (sines[i][j] * squares[i])
    return matrix, right


def own_scale(scene: Scene) -> float:
    """A power of two near the fastest thing that the scene names, 1/s. It decides how large errors are, not if."""
    terms: Any = scene.terms
    fast = [float(np.abs(scene.rates).max())]
    if "gravity" in terms:
        fast.append(scene.n * math.sqrt(terms["gravity"].gravity / scene.total_length))
    fast += [terms[drive].frequency for drive in ("driven_pivot", "drive_torque") if drive in terms]
    return 2.0 ** round(math.log2(max(fast))) if max(fast) > 0.0 else 1.0


def _matrix(c: Constants, theta: Sequence[Number], apart: Lower | None = None) -> tuple[Lower, Lower, Lower]:
    """C, and the sines and cosines of theta_i - theta_j: lower halves, without the diagonal for these two."""
    pairs = [[sine_cosine(apart[i][j] if apart else theta[i] - theta[j]) for j in range(i)] for i in range(c.n)]
    sines, cosines = ([[pair[k] for pair in row] for row in pairs] for k in (0, 1))
    matrix = [
        [*(c.inertia[i][j] * cosines[i][j] + c.rotors[i][j] for j in range(i)), c.inertia[i][i] + c.rotors[i][i]]
        for i in range(c.n)
    ]
    return matrix, sines, cosines


def _forces(c: Constants, theta: Sequence[Number], omega: Sequence[Number], cosines: Lower, t: Number) -> list[Number]:
    """Q - h of (E6), of all effects: N m for each rod."""
    right = _pulls(c, theta, t)
    for i, torque in enumerate(_joints(c, theta, omega, t)):
        right[i] = right[i] + torque
        if i > 0:
            right[i - 1] = right[i - 1] - torque
    for i in range(c.n):
        for j in range(i + 1):
            if c.drag[i][j].is_zero():
                continue
            if i == j:
                right[i] = right[i] - omega[i] * c.drag[i][i]
                continue
            push = cosines[i][j] * c.drag[i][j]
            right[i], right[j] = right[i] - push * omega[j], right[j] - push * omega[i]
    return right


def _pulls(c: Constants, theta: Sequence[Number], t: Number) -> list[Number]:
    """What gravity and the pivot do: -M l (cos x + sin y) of its acceleration, -D l (cos x + sin y) of its velocity."""
    zero = 0 * theta[0]
    if c.pivot is None:
        return [-(sine_cosine(a)[0] * (w * c.gravity)) + zero for a, w in zip(theta, c.weights, strict=True)]
    x, y, frequency, phase = c.pivot
    sine, cosine = sine_cosine(t * frequency + phase)
    right = []
    for angle, weight, drag in zip(theta, c.weights, c.pulled, strict=True):
        s, k = sine_cosine(angle)
        along, speed = sine * (-frequency * frequency), cosine * frequency
        shaken = k * (along * x) + s * (along * y + c.gravity)
        right.append(-(shaken * weight) - (k * (speed * x) + s * (speed * y)) * drag)
    return right


def _joints(c: Constants, theta: Sequence[Number], omega: Sequence[Number], t: Number) -> list[Number]:
    """The torque in each joint: on its rod, and the opposite on the one before."""
    torques = []
    for i in range(c.n):
        bend = theta[i] - theta[i - 1] if i > 0 else theta[i]
        rate = omega[i] - omega[i - 1] if i > 0 else omega[i]
        torque = c.torque[i] + 0 * bend
        if not c.damping[i].is_zero():
            torque = torque - rate * c.damping[i]
        if not c.stiffness[i].is_zero():
            torque = torque - (bend - c.rest[i]) * c.stiffness[i]
        if c.motor is not None and c.motor[0] == i:
            _, amplitude, frequency, phase = c.motor
            torque = torque + sine_cosine(t * frequency + phase)[0] * amplitude
        torques.append(torque)
    return torques
