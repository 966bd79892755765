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

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import compiled, inlined
from pendbench.solvers.closing import Chain
from pendbench.solvers.copying import copy_rows
from pendbench.solvers.methods import FixedStep, Form, add
from pendbench.solvers.multipliers import guess_forces, rows_of
from pendbench.solvers.rattle import FINEST, LAST, PARTS, State, begin, take_steps, write_start, write_state

#: A frame that asks for more steps than this is given up.
MOST_SUBSTEPS = FINEST

#: The largest h W. Chains of 5 to 500 links, released horizontally, then keep their energy within 0.6 % of its scale.
LONGEST = 0.4


@inlined
def _frame(chain: Chain, memory: FloatArray, kept: FloatArray, steps: FloatArray, room: FloatArray, dt: float) -> bool:
    """Take a frame of dt s in `steps[PARTS]` steps, or in twice as many as often as it takes; else undo all.

    kept (KEPT, n + 2): room for that.
    """
    copy_rows(memory, kept)
    before = steps[LAST]
    while True:
        h, count = dt / steps[PARTS], int(steps[PARTS])
        if take_steps(chain, memory, steps, room, h, count, np.inf, (LONGEST / h) ** 2) == count:
            return True
        copy_rows(kept, memory)
        steps[LAST] = before
        if 2.0 * steps[PARTS] > MOST_SUBSTEPS:
            return False
        steps[PARTS] *= 2.0
        rows = rows_of(memory, room, len(chain.lengths))
        guess_forces(rows, rows.force)


@compiled
def _advance(chain: Chain, memory: FloatArray, steps: FloatArray, room: FloatArray, dt: float, frames: int) -> int:
    kept, taken = np.empty_like(memory), 0
    while taken < frames and _frame(chain, memory, kept, steps, room, dt):
        taken += 1
    return taken


def take_frames(chain: Chain, state: State, first: int, dt: float, steps: int) -> int:  # noqa: ARG001
    """Take steps as `methods.FixedStep` says, each a frame."""
    write_start(chain, state)
    taken: int = _advance(chain, state.memory, state.steps, state.room, dt, steps)
    write_state(chain, state)
    return taken


add(
    FixedStep(
        "frame",
        order=2,
        note="RATTLE in as many equal steps as needed",
        form=Form.RODS,
        begin=begin,
        advance=take_frames,
        stuck=f"the chain moves too fast for {MOST_SUBSTEPS} steps in a frame",
        remedy="a shorter frame would do",
        substeps=True,
    )
)
