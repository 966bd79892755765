"""The methods with a fixed step: a file each, in this folder, that ends by adding its own to `METHODS`.

To add one, write its file: `heun.py`, say, with its coefficients and

    add(runge_kutta_method("heun", HEUN, note="Heun's method, two stages"))

or with a loop of its own, as `euler.py` has. Nothing else has to know of it.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from importlib import import_module
from typing import Any

import pendbench.solvers


class Form(Enum):
    """The variables that a method advances, and with them what `begin` gets and what its state has to hold."""

    RATES = "angles and rates"  # begin(q, v); state.q, state.v
    MOMENTA = "angles and momenta"  # begin(q, p, v); state.q, state.p
    RODS = "the rods in the plane"  # begin(q, v); state.q, state.v and state.gap, written after each call


@dataclass(frozen=True)
class FixedStep:
    """A method with a fixed step.

    begin: copies the start, arrays (d,) or (n, 2), into a state that holds all that is kept from step to step.
    advance(system, state, first, dt, steps): take the steps from number `first` on, each of dt (s), the one with number
    0 at time 0, and return how many could be taken. order: what it claims. note: a line for the documentation.
    substeps: it divides its step as it sees fit. conserves: its formula keeps the energy. stuck and remedy: what to say
    where a step could not be taken, and what would help. threads: how many it can use; where more than one, the last
    argument of advance is how many it may.
    """

    name: str
    order: int
    note: str
    form: Form
    begin: Callable[..., Any]
    advance: Callable[..., int]
    stuck: str = ""
    remedy: str = ""
    substeps: bool = False
    conserves: bool = False
    threads: int = 1


_added: dict[str, FixedStep] = {}


def add(method: FixedStep) -> None:
    """Make a method known."""
    _added[method.name] = method


def fixed_step_methods() -> Mapping[str, FixedStep]:
    """All of them, by name."""
    for module in pkgutil.iter_modules(pendbench.solvers.__path__, "pendbench.solvers."):
        if not module.ispkg:
            import_module(module.name)
    return {name: _added[name] for name in sorted(_added)}
