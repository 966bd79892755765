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

from typing import Any, NamedTuple

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled
from pendbench.solvers.copying import copy, copy_rows
from pendbench.solvers.methods import FixedStep, Form, add
from pendbench.solvers.rattle import Ends, Rods, ends_at, take_steps

#: A frame that asks for more steps than this is given up.
MOST_SUBSTEPS = 4096

#: The largest h W. Chains of 5 to 500 links, released horizontally, then keep their energy within 0.6 % of its scale.
LONGEST = 0.4


class _State(NamedTuple):
    """What `rattle.Ends` has, and substeps (1,): in how many steps the last frame was cut."""

    points: FloatArray
    speeds: FloatArray
    forces: FloatArray
    turns: FloatArray
    substeps: Any


def begin(points: FloatArray, speeds: FloatArray) -> _State:
    """The state at the start, copied."""
    return _State(*ends_at(points, speeds)[:4], np.ones(1, np.int64))


@compiled
def _copy_ends(source: Ends, target: Ends) -> None:
    copy_rows(source.points, target.points)
    copy_rows(source.speeds, target.speeds)
    copy(source.forces, target.forces)
    copy(source.turns, target.turns)


@compiled
def _advance(
    rods: Rods,
    points: FloatArray,
    speeds: FloatArray,
    forces: FloatArray,
    turns: FloatArray,
    substeps: Any,
    frame: float,
    frames: int,
) -> int:
    """Take frames of `frame` (s) in `substeps[0]` steps each, or in twice as many as often as it takes.

    Stops at the start of the first frame that would need more than MOST_SUBSTEPS steps, and returns how many it took.
    """
    ends = Ends(points, speeds, forces, turns, np.empty_like(points), np.empty_like(speeds))
    kept = Ends(
        np.empty_like(points), np.empty_like(speeds), np.empty_like(forces), np.empty_like(turns), points, speeds
    )
    for taken in range(frames):
        _copy_ends(ends, kept)
        while take_steps(rods, ends, frame / substeps[0], substeps[0], LONGEST**2) < substeps[0]:
            for i in range(len(kept.forces)):
                kept.forces[i] *= 0.25  # multipliers go with the square of the step
            _copy_ends(kept, ends)
            if 2 * substeps[0] > MOST_SUBSTEPS:
                return taken
            substeps[0] *= 2
    return frames


def take_frames(rods: Rods, state: _State, first: int, dt: float, steps: int) -> int:  # noqa: ARG001
    """Take steps as `methods.FixedStep` says, each a frame."""
    taken: int = _advance(rods, *state, dt, steps)
    return taken


add(
    FixedStep(
        "frame",
        order=2,
        note="RATTLE in as many equal steps as needed",
        form=Form.ENDS,
        begin=begin,
        advance=take_frames,
        stuck=f"the chain moves too fast for {MOST_SUBSTEPS} steps in a frame",
        remedy="a shorter frame would do",
        substeps=True,
    )
)
