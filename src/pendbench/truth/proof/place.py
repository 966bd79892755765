"""Where the state can be: a point, and a turned box around it (Lohner's form), which steps carry on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from pendbench.truth.proof.bounds import BITS, Bounds
from pendbench.truth.proof.numbers import Number, precision
from pendbench.truth.proof.polynomials import Effort, Path

#: Edges of a box are too alike where the condition of their matrix is this: so much is lost of what is added to it.
_ALIKE = 1e6


@dataclass(frozen=True)
class Place:
    """All states ``centre + frame r`` with ``|r_i| <= radii_i``.

    centre: (2 n) exact. frame: a matrix (2 n, 2 n) of exact numbers. radii: (2 n) upper bounds.
    """

    centre: list[Number]
    frame: Any
    radii: list[Number]

    def extent(self) -> Number:
        """The largest that a state is off the centre, in any component."""
        first, *others = spread(self.frame, self.radii)
        return reduce(lambda a, b: a.max(b), others, first).abs_upper()

    def balls(self) -> list[Number]:
        """A ball for each component."""
        from flint import arb

        return [c + arb(0, r) for c, r in zip(self.centre, spread(self.frame, self.radii), strict=True)]


def at(balls: Sequence[Number]) -> Place:
    """The smallest place that holds a ball for each component."""
    from flint import arb_mat

    size = len(balls)
    one = arb_mat([[int(i == j) for j in range(size)] for i in range(size)])
    return Place([ball.mid() for ball in balls], one, [ball.rad() for ball in balls])


def spread(matrix: Any, radii: Sequence[Number]) -> list[Number]:
    """How far ``matrix r`` goes in each component, for ``|r_i| <= radii_i``; upper bounds."""
    from flint import arb

    with precision(BITS):
        rows = matrix.tolist()
        return [sum((a.abs_upper() * r for a, r in zip(row, radii, strict=True)), arb(0)).abs_upper() for row in rows]


def _error(place: Place, bounds: Bounds) -> Number | None:
    """How far a solution from the place is from what path and variation say, at most; None where that is not proved."""
    with precision(BITS):
        extent = place.extent()
        if not extent < bounds.farthest:
            return None
        return (bounds.centre + bounds.variation * extent + bounds.bend * extent**2).abs_upper()


def seen(place: Place, path: Path, bounds: Bounds, u: Number, effort: Effort) -> list[Number] | None:
    """A ball for each component of the state after u (0 to the bounds' length); None where that is not proved."""
    from flint import arb

    error = _error(place, bounds)
    if error is None:
        return None
    with precision(effort.small_bits):
        wide = spread(_variation_at(path, u) * place.frame, place.radii)
    with precision(effort.bits):
        values = [_value(its, u) for its in path.state]
        return [v + arb(0, w) + arb(0, error) for v, w in zip(values, wide, strict=True)]


def carried(place: Place, path: Path, bounds: Bounds, effort: Effort) -> Place | None:
    """A place that holds all solutions from `place` at the end of the step; None where that is not proved."""
    error = _error(place, bounds)
    if error is None:
        return None
    with precision(effort.bits):
        values = [_value(its, bounds.length) for its in path.state]
        centre = [value.mid() for value in values]
    with precision(effort.small_bits):
        turned = _variation_at(path, bounds.length) * place.frame
        frame = _frame(turned, place.radii)
        back = frame.inv()
        kept = spread(back * turned, place.radii)
    with precision(BITS):
        errors = [(value.rad() + error).abs_upper() for value in values]
        more = spread(back, errors)
        return Place(centre, frame, [(a + b).abs_upper() for a, b in zip(kept, more, strict=True)])


def _value(coefficients: Sequence[Number], u: Number) -> Number:
    from flint import arb

    value = arb(0)
    for c in reversed(coefficients):
        value = value * u + c
    return value


def _variation_at(path: Path, u: Number) -> Any:
    value = path.variation[-1]
    for its in reversed(path.variation[:-1]):
        value = value * u + its
    return value


def _frame(turned: Any, radii: Sequence[Number]) -> Any:
    """A frame for the turned box: its own edges, or where they have become too alike, orthogonal ones.

    Any invertible one would do: doubles are good enough. The box's own edges hold it as it is, and nothing is added;
    but those of a chaotic motion all turn in one direction. Orthogonal ones begin with its longest.
    """
    from flint import arb, arb_mat

    matrix = np.array([[float(entry.mid()) for entry in row] for row in turned.tolist()])
    lengths = np.linalg.norm(matrix, axis=0)
    frame = matrix / lengths
    if not np.linalg.cond(frame) < _ALIKE:
        sizes = np.array([float(r) for r in radii])
        longest = np.argsort(-lengths * (sizes / sizes.max() if sizes.max() > 0.0 else 1.0), kind="stable")
        frame = np.linalg.qr(matrix[:, longest])[0]
    return arb_mat([[arb(float(entry)) for entry in row] for row in frame])
