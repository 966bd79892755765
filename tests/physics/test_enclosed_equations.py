"""What a proof encloses, every effect included, is the Lagrangian's: derived in symbols, compared in 50 digits.

An identity between analytic expressions that holds at a point chosen by chance holds everywhere, but for a chance of
nothing. Numbers of mpmath stand in for flint's, so that nothing but the code that is enclosed is looked at.
"""

from __future__ import annotations

import sys
from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import mpmath as mp
import numpy as np
import pytest
import sympy as sp

from pendbench.scene.scene import Scene
from pendbench.truth.proof import system
from support.effect_sets import USUAL

N = 3
LINKS = range(N)
DIGITS = 50
T = sp.Symbol("t")
ANGLE, RATE, ACCELERATION = (sp.symbols(f"{name}1:{N + 1}") for name in ("theta", "omega", "alpha"))
#: Numbers of a scene, each for every link.
EACH = {
    name: sp.symbols(f"{name}1:{N + 1}")
    for name in ("point", "length", "body", "centre", "inertia", "damping", "spring", "rest", "torque", "drag", "rotor")
}
ALONE = {name: sp.Symbol(name) for name in ("g", "x", "y", "shaking", "shift", "motor", "turning", "lag")}
MOTOR_JOINT = 1


def rate(expression):
    """The rate of an expression in angles and time."""
    return sp.diff(expression, T) + sum(sp.diff(expression, a) * w for a, w in zip(ANGLE, RATE, strict=True))


def squared(point):
    return sum(rate(part) ** 2 for part in point)


def places():
    """The rods' beginnings, from the pivot on, and where each mass is; beside them the bodies' centres."""
    shaken = sp.sin(ALONE["shaking"] * T + ALONE["shift"])
    ends = [(ALONE["x"] * shaken, ALONE["y"] * shaken)]
    centres = []
    for angle, length, centre in zip(ANGLE, EACH["length"], EACH["centre"], strict=True):
        x, y = ends[-1]
        centres.append((x + centre * sp.sin(angle), y - centre * sp.cos(angle)))
        ends.append((x + length * sp.sin(angle), y - length * sp.cos(angle)))
    return ends, centres


def across_joints(values):
    """What each joint has between its rod and the one before, which for the first is the wall."""
    return [after - before for before, after in pairwise((0, *values))]


@cache
def derived():
    """d/dt dL/domega - dL/dtheta + dR/domega - Q for each rod, and the matrix d^2L/domega^2: functions of numbers."""
    ends, centres = places()
    kinetic = potential = dissipated = sp.Integer(0)
    bodies = (*zip(EACH["point"], ends[1:], strict=True), *zip(EACH["body"], centres, strict=True))
    for mass, place in bodies:
        kinetic += mass * squared(place) / 2
        potential += mass * ALONE["g"] * place[1]
    bends, turns = across_joints(ANGLE), across_joints(RATE)
    for i in LINKS:
        kinetic += EACH["inertia"][i] * RATE[i] ** 2 / 2 + EACH["rotor"][i] * turns[i] ** 2 / 2
        potential += EACH["spring"][i] * (bends[i] - EACH["rest"][i]) ** 2 / 2
        dissipated += EACH["damping"][i] * turns[i] ** 2 / 2 + EACH["drag"][i] * squared(ends[i + 1]) / 2
    motor = ALONE["motor"] * sp.sin(ALONE["turning"] * T + ALONE["lag"])
    torques = [EACH["torque"][i] + (motor if i == MOTOR_JOINT else 0) for i in LINKS]
    work = sum(torque * bend for torque, bend in zip(torques, bends, strict=True))
    equations = []
    for angle, omega in zip(ANGLE, RATE, strict=True):
        momentum = sp.diff(kinetic, omega)
        change = rate(momentum) + sum(sp.diff(momentum, w) * a for w, a in zip(RATE, ACCELERATION, strict=True))
        equations.append(
            change - sp.diff(kinetic - potential, angle) + sp.diff(dissipated, omega) - sp.diff(work, angle)
        )
    matrix = [sp.diff(kinetic, a, b) for a in RATE for b in RATE]
    known = [*ANGLE, *RATE, *ACCELERATION, T, *ALONE.values(), *(its for each in EACH.values() for its in each)]
    return sp.lambdify(known, [*equations, *matrix], "mpmath", cse=True)


class Digits:
    """A number of 50 digits with what the enclosed code asks of a ball."""

    def __init__(self, value):
        self.value = mp.mpf(value)

    def __add__(self, other):
        return Digits(self.value + plain(other))

    def __sub__(self, other):
        return Digits(self.value - plain(other))

    def __mul__(self, other):
        return Digits(self.value * plain(other))

    def __truediv__(self, other):
        return Digits(self.value / plain(other))

    def __rtruediv__(self, other):
        return Digits(plain(other) / self.value)

    def __neg__(self):
        return Digits(-self.value)

    __radd__, __rmul__ = __add__, __mul__

    def sin_cos(self):
        return Digits(mp.sin(self.value)), Digits(mp.cos(self.value))

    def is_zero(self):
        return self.value == 0

    def abs_upper(self):
        return abs(self.value)


def plain(x):
    return x.value if isinstance(x, Digits) else x


def solved(lower, right):
    whole = mp.matrix(N, N)
    for i in LINKS:
        for j in LINKS:
            whole[i, j] = plain(lower[max(i, j)][min(i, j)])
    return [Digits(x) for x in mp.lu_solve(whole, mp.matrix([plain(its) for its in right]))]


@pytest.fixture(autouse=True)
def numbers(monkeypatch):
    monkeypatch.setitem(sys.modules, "flint", SimpleNamespace(arb=Digits))
    monkeypatch.setattr(system, "solve", solved)
    with mp.workdps(DIGITS):
        yield


def eighths(rng, low, high, size=N):
    """Numbers that doubles hold exactly."""
    return (rng.integers(round(8 * low), round(8 * high), size) / 8).tolist()


def scene_at(seed, kind):
    """A chain with every effect that can be proved, its numbers by chance."""
    rng = np.random.default_rng(seed)
    each = {
        "joint_damping": eighths(rng, 0.25, 2),
        "joint_stiffness": eighths(rng, 0.25, 2),
        "joint_rest": eighths(rng, -2, 2),
        "joint_torque": eighths(rng, -2, 2),
        "armature": eighths(rng, 0.25, 2),
        "air_drag": {"linear": eighths(rng, 0.25, 2)},
    }
    size, fast, phase = eighths(rng, 0.25, 2, 2), eighths(rng, 1, 9, 2), eighths(rng, -2, 2, 2)
    each["driven_pivot"] = {
        "axis": "xy"[seed % 2],
        "amplitude": size[0],
        "angular_frequency": fast[0],
        "phase": phase[0],
    }
    each["drive_torque"] = {
        "joint": MOTOR_JOINT + 1,
        "amplitude": size[1],
        "angular_frequency": fast[1],
        "phase": phase[1],
    }
    if kind == "links":
        own = {"links": {"mass": eighths(rng, 1, 2), "centre": eighths(rng, -1, 1), "inertia": eighths(rng, 1, 2)}}
    else:
        own = {"mass": eighths(rng, 1, 2), "rod_mass": eighths(rng, 0.25, 2)}
    return Scene.chain(
        length=eighths(rng, 0.5, 2), angles=eighths(rng, -3, 3), rates=eighths(rng, -3, 3), gravity=9.75, **each, **own
    )


def bodies(scene):
    """Mass, centre and inertia of each body: those of links, or a uniform rod's, by integrating along it."""
    if scene.links is not None:
        return [list(map(mp.mpf, its)) for its in (scene.links.mass, scene.links.centre, scene.links.inertia)]
    s, length = sp.symbols("s l")
    mean = sp.integrate(s, (s, 0, length)) / length
    spread = sp.integrate((s - mean) ** 2, (s, 0, length)) / length
    lengths, masses = map(mp.mpf, scene.lengths), list(map(mp.mpf, scene.effects.rod_mass))
    found = [[sp.lambdify(length, its, "mpmath")(x) for its in (mean, spread)] for x in lengths]
    return [masses, [centre for centre, _ in found], [m * its for m, (_, its) in zip(masses, found, strict=True)]]


def values(scene, accelerations, t, without=()):
    """What the derived functions take."""
    its = scene.effects
    body, centre, inertia = bodies(scene)
    shaken, motor = its.driven_pivot, its.drive_torque
    along = {"x": 0.0, "y": 0.0} | {shaken.axis: shaken.amplitude}
    alone = {
        "g": its.gravity,
        **along,
        "shaking": shaken.angular_frequency,
        "shift": shaken.phase,
        "motor": motor.amplitude,
        "turning": motor.angular_frequency,
        "lag": motor.phase,
    }
    each = {
        "point": scene.masses,
        "length": scene.lengths,
        "body": body,
        "centre": centre,
        "inertia": inertia,
        "damping": its.joint_damping,
        "spring": its.joint_stiffness,
        "rest": its.joint_rest,
        "torque": its.joint_torque,
        "drag": its.air_drag.linear,
        "rotor": its.armature,
    }
    given = [alone[name] * (name not in without) for name in ALONE]
    given += [x * (name not in without) for name in EACH for x in each[name]]
    return list(map(mp.mpf, [*scene.angles, *scene.rates, *accelerations, t, *given]))


def left_over(scene, seed, **changed):
    """How far C theta'' - (S omega^2 - h + Q), as enclosed, is from what is derived, in each row; and C from C."""
    accelerations, t = eighths(np.random.default_rng(seed + 100), -9, 9), 0.625
    found = derived()(*values(scene, accelerations, t, **changed))
    angles, rates = (list(map(Digits, its.tolist())) for its in (scene.angles, scene.rates))
    lower, right = system.balance(system.constants(scene), angles, rates, Digits(t))
    matrix = [[plain(lower[max(i, j)][min(i, j)]) for j in LINKS] for i in LINKS]
    rows = [mp.fdot(row, accelerations) - plain(its) for row, its in zip(matrix, right, strict=True)]
    rows += [entry for row in matrix for entry in row]
    return max(abs(a - b) for a, b in zip(rows, found, strict=True))


POINTS = [(seed, kind) for seed in (1, 2) for kind in ("links", "rods")]
CLOSE = 1e-45


@pytest.mark.parametrize(("seed", "kind"), POINTS)
def test_every_effect_that_is_enclosed_is_the_lagrangian_s(seed, kind):
    scene = scene_at(seed, kind)
    assert {name for name in USUAL if name in scene.terms} == set(scene.terms) - {"links"}
    assert left_over(scene, seed) < CLOSE


def test_nothing_that_can_be_proved_is_left_out():
    assert {name for kind in ("links", "rods") for name in scene_at(1, kind).terms} == system.KNOWN


@pytest.mark.parametrize(
    "effect", ["g", "y", "motor", "body", "centre", "inertia", "damping", "spring", "rest", "torque", "drag", "rotor"]
)
def test_an_effect_that_were_missing_would_show(effect):
    assert left_over(scene_at(1, "links"), 1, without=(effect,)) > 1e-3


@pytest.mark.parametrize(("seed", "kind"), POINTS)
def test_the_form_with_momenta_is_the_same_motion(seed, kind):
    """Momenta are C omega, so p' = C theta'' + C' omega: C as derived, C' as its difference along the motion."""
    scene, t, step = scene_at(seed, kind), 0.625, mp.mpf(10) ** -15
    rates, momenta = system.Rates(scene), system.Momenta(scene)
    accelerations = [plain(its) * rates.scale for its in rates.slope(rates.start(scene), Digits(t))[N:]]
    found = [plain(its) * momenta.unit for its in momenta.slope(momenta.start(scene), Digits(t))[N:]]
    omega = mp.matrix(scene.rates.tolist())

    def matrix(moved):
        angles = [a + moved * w for a, w in zip(scene.angles.tolist(), omega, strict=True)]
        entries = derived()(*angles, *values(scene, accelerations, t)[N:])[N:]
        return mp.matrix([entries[N * i : N * i + N] for i in LINKS])

    wanted = matrix(0) * mp.matrix(accelerations) + (matrix(step) - matrix(-step)) * omega / (2 * step)
    assert max(abs(a - b) for a, b in zip(found, wanted, strict=True)) < 1e-25
