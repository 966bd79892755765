"""RATTLE for long chains at the step of a picture, 1/240 s: each frame is cut into as many equal steps as it asks for.

How many is decided by the tensions. A point of mass m_i between rods of tension T and length l is held across each of
them by a stiffness T / l, so by Gershgorin's circles no oscillation of the chain is faster than

    W^2 = max_i 2 (|T_i| / l_i + |T_{i+1}| / l_{i+1}) / m_i

(2 n sqrt(g / L) for a rope at rest). Turning rods are held on their circles by tensions too: without gravity, none in
a chain of equal rods and masses turns faster than W. Stormer-Verlet is unstable from h W = 2, and its error in energy
grows like (h W)^2. A frame with a step that has h W > `LONGEST`, or that does not converge, is begun again with twice
as many.

Their number never falls. No energy is lost, so a crack of the whip comes again; and a step that follows the motion
makes the error in energy a random walk. With the step chosen anew at every step, the energy of a rope of 100 links
wandered ten times as far in 100 s as with equal steps of the same cost. This way the step changes a few times in the
life of a chain and in between the method is symplectic: the energy has a band and no slope.

Source for what changing steps do to a symplectic method: Hairer, Lubich, Wanner, Geometric Numerical Integration,
VIII.1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.compiled import compiled, inlined
from pendbench.solvers.copying import copy, copy_rows
from pendbench.solvers.rattle import Rods, accept_step, try_step

#: A frame that asks for more steps than this is given up.
MOST_SUBSTEPS = 4096

#: The largest h W. Chains of 5 to 500 links, released horizontally, then keep their energy within 0.6 % of its scale.
LONGEST = 0.4


class Progress(NamedTuple):
    """How many frames were taken, and in how many steps the last was cut."""

    frames: int
    substeps: int


@inlined
def quickness(masses: FloatArray, forces: FloatArray) -> float:
    """(h W)^2 of the step whose multipliers were forces (n,), -h^2 T / (2 l) kg; nan where one of them is.

    masses (n,) kg; W is the bound on the chain's frequencies above.
    """
    most, n = 0.0, len(masses)
    for i in range(n):
        outer = abs(forces[i + 1]) if i + 1 < n else 0.0
        squared = 4.0 * (abs(forces[i]) + outer) / masses[i]
        if not squared <= most:  # so that nan counts
            most = squared
    return most


@inlined
def _cross(
    rods: Rods,
    h: float,
    points: FloatArray,
    speeds: FloatArray,
    forces: FloatArray,
    turns: FloatArray,
    new_points: FloatArray,
    new_speeds: FloatArray,
    steps: int,
) -> bool:
    """Take the steps of one frame; False at the first that is too long."""
    for _ in range(steps):
        if not try_step(rods, h, points, speeds, forces, new_points, new_speeds):
            return False
        if not quickness(rods.masses, forces) <= LONGEST**2:
            return False
        accept_step(rods, points, speeds, turns, new_points, new_speeds)
    return True


@compiled
def advance(
    rods: Rods,
    frame: float,
    substeps: int,
    points: FloatArray,
    speeds: FloatArray,
    forces: FloatArray,
    turns: FloatArray,
    frames: int,
) -> Progress:
    """Take frames of `frame` (s) in `substeps` steps each, or in twice as many as often as it takes.

    points (n, 2) m, speeds (n, 2) m/s, forces (n,) and turns (n,) are those of `rattle.rattle`, changed in place.
    Stops at the start of the first frame that would need more than MOST_SUBSTEPS steps.
    """
    new_points, new_speeds = np.empty_like(points), np.empty_like(speeds)
    kept_points, kept_speeds = np.empty_like(points), np.empty_like(speeds)
    kept_forces, kept_turns = np.empty_like(forces), np.empty_like(turns)
    for taken in range(frames):
        copy_rows(points, kept_points)
        copy_rows(speeds, kept_speeds)
        copy(forces, kept_forces)
        copy(turns, kept_turns)
        while not _cross(rods, frame / substeps, points, speeds, forces, turns, new_points, new_speeds, substeps):
            copy_rows(kept_points, points)
            copy_rows(kept_speeds, speeds)
            copy(kept_turns, turns)
            if 2 * substeps > MOST_SUBSTEPS:
                return Progress(taken, substeps)
            substeps *= 2
            for i in range(len(forces)):
                kept_forces[i] *= 0.25  # multipliers go with the square of the step
                forces[i] = kept_forces[i]
    return Progress(frames, substeps)
