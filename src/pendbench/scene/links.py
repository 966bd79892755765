"""Rigid links: what each weighs, where its centre is, and how hard it is to turn about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.ranges import Range
from pendbench.base.strict import show

LINK_MASS: Final = Range(1e-50, 1e50, "kg")
CENTRE: Final = Range(-1e50, 1e50, "m")
INERTIA: Final = Range(0.0, 1e150, "kg m^2")
#: What they are called among a scene's effects, and two that show, of about 0.5 m, for the checks of every engine.
LINKS: Final = "links"
EXAMPLE: Final[Mapping[str, Any]] = {"mass": [0.8, 0.6], "centre": [0.35, 0.15], "inertia": [0.02, 0.01]}
#: How far from its joint a link's mass may be, in lengths of the link: squares of masses' distances stay finite.
FARTHEST: Final = 1e6


@dataclass(frozen=True, eq=False)
class Links:
    """Rigid links instead of point masses on massless rods, from the pivot outwards.

    mass: (n,) kg. centre: (n,) m, from the link's joint along the link: beyond its end, or behind its joint where it is
    negative. inertia: (n,) kg m^2, about that centre; 0 is a point mass. In a `Scene` all three are arrays; what makes
    one may have a number that is meant for every link.
    """

    mass: FloatArray
    centre: FloatArray
    inertia: FloatArray


def check_links(links: Links, lengths: FloatArray) -> None:
    """Raise `InputError` for links of these lengths (n,) m that nothing real could be."""
    about_joint = links.inertia + links.mass * links.centre**2
    if loose := np.flatnonzero(about_joint == 0.0).tolist():
        raise InputError(f"link {loose[0] + 1} has its mass in its joint; allowed: a centre or an inertia other than 0")
    far = np.abs(links.centre) > FARTHEST * lengths
    wide = links.inertia > links.mass * (FARTHEST * lengths) ** 2
    for name, values, outside in (("centre", links.centre, far), ("inertia", links.inertia, wide)):
        if found := np.flatnonzero(outside).tolist():
            said = f"{name}, entry {found[0] + 1}, is {show(float(values[found[0]]))}"
            raise InputError(f"{said}; allowed: no mass beyond {FARTHEST:g} lengths of its link")
