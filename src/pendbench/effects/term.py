"""What an effect may add to the equations: the laws that its term can have. To add an effect, read this page.

A term is a NamedTuple of floats and arrays (n,). It has:

- `of(value, n)`: the term for a chain of n links, from the value in the scene; raises `InputError` if they do not fit.
- `is_nothing()`: whether all its numbers are 0, so that it can be left out.
- `example()`: a value for two links as it stands in a file, unlike for each, for the checks that every engine passes.
- `modifies()`, where all it does is in the law of another effect: that effect's name. The other's `of` gets the value
  of this one too, by this one's name, and a scene that has not got the other is refused.

and one or more of these laws, static methods in plain arithmetic (`+ - * /`, `np.sin`, `np.cos`, `np.sqrt`), which are
compiled, and called with numpy arrays, and with numbers of 32 digits. Where all numbers of a term are 0 its laws give
0: the reference has every effect in every scene, so that it is compiled once.

- `pivot_acceleration(term, t)`: (x, y) m/s^2, what the pivot's acceleration against free fall is at time t s, and
  `pivot_velocity(term, t)`: (x, y) m/s, with which the chain moves through the air, and
  `pivot_position(term, t)`: (x, y) m, where that takes it, for pictures.
- `mass_potential(term, x, y)`: J/kg at (x, y) m from the pivot, where a constant acceleration has a potential; an
  acceleration without one does work.
- `joint_torque(term, drive, i, bend, rate)`: N m, what joint i feels, along its angle: on rod i, and against rod i - 1.
  bend rad and rate rad/s: the rod's against the rod before it, or against the vertical for the first.
- `joint_potential(term, i, bend)`: J, where the torque has one; a torque without one has a power.
- `drag(term, i, x, y)`: (x, y) N, the force on mass i at velocity (x, y) m/s through the air. The law must look the
  same from every direction: the recursion calls it in the rod's own frame, the dense form in that of the ground.
- `drive(term, t)`: a number that the joint's law gets, the same for all joints, so that it is computed once.
- `rod_masses(term)`: (n,) kg, of uniform rods.
- `rotor_inertias(term)`: (n,) kg m^2, that turn with the joints' own angles.

i is an index in a kernel and `...` for numpy, where bend, rate, x and y are arrays (..., n). An effect that pushes in
none of these ways needs a law more, here and in `physics/kernels/laws.py`.

Then add the effect's line to `Effects`. The solvers, the energy, the truth and the studies know it from there. An
engine refuses it until its adapter's `effects` says by what means it simulates it. MuJoCo, pymunk and Pinocchio compute
what they have no means for from the laws above, so that a line is all they need, and the conformance kit looks at what
comes of it. `python -m pendbench.engines.effects_table` writes the table of docs/effects.md. What is left is to measure
it and to hold it: a scene in `models/` and in `studies/effects.toml`, a line in `tests/support/effect_sets.py`, and
what its value means in docs/effects.md.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError


class Term(Protocol):
    """What an effect adds to the equations of one chain."""

    @classmethod
    def of(cls, value: Any, n: int) -> Term:
        """The term for a chain of n links. Raises `InputError` where the value does not fit them."""

    @staticmethod
    def example() -> Any:
        """A value that shows: it changes two links of about 1 kg and 1 m by a tenth, rad or rad/s, in half a second."""

    def is_nothing(self) -> bool:
        """Whether it does nothing: all its numbers are 0."""


def each(values: float | tuple[float, ...], n: int, name: str, of: str) -> FloatArray:
    """One number for each of n joints or rods (`of`), as (n,). Raises `InputError` for lists of other lengths."""
    if isinstance(values, tuple) and len(values) != n:
        count = f"{len(values)} {'entry' if len(values) == 1 else 'entries'}"
        raise InputError(f"{name} has {count}; allowed: one number, or one for each of the {n} {of}")
    return np.array(np.broadcast_to(np.asarray(values, dtype=np.float64), (n,)))
