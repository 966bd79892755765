"""The type of the project's arrays, and what stands for nothing in them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def no_numbers() -> FloatArray:
    """The array (0,) of a record in which nothing was found."""
    return np.zeros(0)


def no_rows() -> FloatArray:
    """A table without rows, (0, 0)."""
    return np.zeros((0, 0))


def all_finite(*arrays: FloatArray) -> bool:
    """Whether no number of these arrays is nan or infinite."""
    return all(np.isfinite(array).all() for array in arrays)  # np.all() takes half as long again


def largest(values: FloatArray) -> float:
    """The largest of some numbers; nan where there are none."""
    return float(values.max()) if len(values) else math.nan
