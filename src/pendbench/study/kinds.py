"""The kinds of study. A kind is a module of this package; adding one is adding its name here."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

if TYPE_CHECKING:
    from pendbench.study.plan import Plan, StudyFile
    from pendbench.study.results import Results
    from pendbench.study.runner import Runner

#: The kinds whose measures hold with effects beside gravity; the others count on energy being conserved.
WITH_EFFECTS: Final = frozenset({"effects"})

#: Names of kinds, each with its module.
KINDS: Final = {
    "chaos": "pendbench.study.chaos",
    "cost": "pendbench.study.cost",
    "stability": "pendbench.study.stability",
    "ensemble": "pendbench.study.ensemble",
    "scaling": "pendbench.study.scaling",
    "effects": "pendbench.study.effects",
}


class Kind(Protocol):
    """What a kind's module offers."""

    Options: type[StudyFile]
    check: Callable[[Plan], None]  # raises InputError, one line, for what only the kind can see
    run: Callable[[Plan, Runner], Results]


def kind(name: str) -> Kind:
    """The module of a kind."""
    module: Any = import_module(KINDS[name])
    return cast(Kind, module)
