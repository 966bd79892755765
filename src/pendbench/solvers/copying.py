"""Copies of arrays as loops: what numba makes of `a[:] = b` takes six seconds to compile, for its error message."""

from __future__ import annotations

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined


@inlined
def copy(source: FloatArray, target: FloatArray) -> None:
    """Copy (d,) numbers."""
    for i in range(len(source)):
        target[i] = source[i]


@inlined
def copy_rows(source: FloatArray, target: FloatArray) -> None:
    """Copy (d, k) numbers."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]
