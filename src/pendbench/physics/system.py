"""The chain as the compiled kernels see it.

The *type* of a system says which effects it has, so a kernel compiled for it holds their arithmetic and no other.
"""

from __future__ import annotations

from typing import NamedTuple

from pendbench.arrays import FloatArray


class System(NamedTuple):
    """A chain under gravity or free of it.

    masses (n,) kg; lengths (n,) m; ratios (n - 1,) of each mass to the next; gravity m/s^2 (0 where the scene has none:
    it enters once, at the pivot, and costs the same); scratch (5, n): room for the recursion, so that a call allocates
    nothing. One thread, one system.
    """

    masses: FloatArray
    lengths: FloatArray
    inverse_masses: FloatArray
    ratios: FloatArray
    gravity: float
    scratch: FloatArray
