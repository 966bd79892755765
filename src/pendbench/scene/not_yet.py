"""What people ask a scene for that cannot be simulated yet, by the keys that they would write."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_ASKED: Final[Mapping[str, tuple[str, ...]]] = {
    "a cart or a free pivot cannot be simulated yet; allowed: a pivot that is held, or moved by driven_pivot": (
        "cart", "cart_mass", "free_pivot", "pivot_mass", "slider",
    ),
    "dry friction cannot be simulated yet; allowed: joint_damping and air_drag": (
        "coulomb_friction", "dry_friction", "friction", "frictionloss", "joint_friction",
    ),
    "motion in three dimensions cannot be simulated yet; allowed: a chain in a plane": (
        "3d", "azimuth", "azimuths", "dimension", "dimensions", "phi",
    ),
    "a chain held at both ends cannot be simulated yet; allowed: one that hangs from its pivot": (
        "anchor", "both_ends", "closed", "end", "fixed_end", "tip_fixed",
    ),
    "branches cannot be simulated yet; allowed: one chain, link after link": (
        "branch", "branches", "children", "parent", "parents", "tree",
    ),
}  # fmt: skip

#: What is said of each key.
NOT_YET: Final[Mapping[str, str]] = {key: f"{key}: {said}" for said, keys in _ASKED.items() for key in keys}
