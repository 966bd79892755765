"""What the league says of an engine in five words, by rule: how accurate, at what cost, and what as it comes."""

from __future__ import annotations

import math
from typing import Final

#: How much of the known time an engine stays on the truth at its best, and the word for at least so much.
ACCURACY: Final = ((0.99, "exact"), (0.5, "accurate"), (0.2, "fair"), (0.0, "rough"))
#: How many times the cheapest engine's cost its cost for the accuracy is, and the word for up to so much.
COST: Final = ((5.0, "cheap"), (50.0, "affordable"), (math.inf, "dear"))
#: How far the energy strays as it comes, in units of its scale, and the word for up to so much.
STANDARD: Final = ((0.01, "steady"), (0.1, "drifting"), (1.0, "lossy"))
_UNREACHED, _BROKEN = "unreached", "broken"


def accuracy_word(share: float) -> str:
    """For the share of the known time on the truth, 0 to 1, at its best."""
    return next((word for least, word in ACCURACY if share >= least), ACCURACY[-1][1])


def cost_word(ratio: float) -> str:
    """For its cost over the cheapest one's; nan where it does not reach the accuracy."""
    return next((word for most, word in COST if ratio <= most), _UNREACHED)


def standard_word(energy: float) -> str:
    """For the energy's error as it comes; nan, or more than all of it, where runs do not end."""
    return next((word for most, word in STANDARD if energy <= most), _BROKEN)


def verdict(share: float, ratio: float, energy: float) -> str:
    """Five words."""
    return f"{accuracy_word(share)}, {cost_word(ratio)}, {standard_word(energy)} by default"
