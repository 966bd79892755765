"""Loads what every worker needs, in the process that workers are copies of."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Final

_NEEDED: Final = ("numba.core.event", "pendbench.execution.pool")

if "" in sys.path:
    sys.path.remove("")  # a file of the user's that is called like a library is not one
for name in _NEEDED:
    import_module(name)
