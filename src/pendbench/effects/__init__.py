"""The effects that a scene can call for: one file each, and one line each in `Effects`.

An effect's file holds its parameters with their checks, and its term: a NamedTuple of the numbers it needs, with the
laws that say what it does. The laws are written once, for one joint or one mass, in plain arithmetic; numpy evaluates
them for whole arrays in the dense form, the kernels of the recursion compile them, and the reference compiles them for
numbers of 32 digits. `term.py` says which laws there are.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar, cast, get_args, get_type_hints

import numpy as np

from pendbench.base.errors import InputError
from pendbench.base.strict import show
from pendbench.effects.air_drag import AIR_DRAG, AirDrag, AirDragValue
from pendbench.effects.armature import ARMATURE, Armature
from pendbench.effects.drive_torque import DRIVE_TORQUE, DriveTorque, DriveTorqueValue
from pendbench.effects.driven_pivot import DRIVEN_PIVOT, DrivenPivot, DrivenPivotValue
from pendbench.effects.gravity import GRAVITY, Gravity
from pendbench.effects.joint_damping import JOINT_DAMPING, JointDamping
from pendbench.effects.joint_rest import JOINT_REST, JointRest
from pendbench.effects.joint_stiffness import JOINT_STIFFNESS, JointStiffness
from pendbench.effects.joint_torque import JOINT_TORQUE, JointTorque
from pendbench.effects.rod_mass import ROD_MASS, RodMass
from pendbench.effects.term import Term

Each = float | tuple[float, ...]


@dataclass(frozen=True)
class Effects:
    """What acts on the chain. None: the scene does not call for it, and nothing of it is simulated.

    A field here is a key of the table [effects] of a scene file, with what its value may be and the class of its term;
    the effect's file says what the value means. Values can be given as in a file: a list, a dict for a table.
    Raises `InputError` for values that are not allowed. Effects can be compared and hashed.

    >>> import pendbench as pb
    >>> pb.Effects(gravity=9.81, joint_damping=[0.1, 0.2]).named()
    ('gravity', 'joint_damping')
    """

    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}
    KEYS_ARE: ClassVar[str] = "effect"

    gravity: Annotated[float, GRAVITY, Gravity] | None = None
    joint_damping: Annotated[Each, JOINT_DAMPING, JointDamping] | None = None
    joint_stiffness: Annotated[Each, JOINT_STIFFNESS, JointStiffness] | None = None
    joint_rest: Annotated[Each, JOINT_REST, JointRest] | None = None
    joint_torque: Annotated[Each, JOINT_TORQUE, JointTorque] | None = None
    air_drag: Annotated[AirDragValue, AIR_DRAG, AirDrag] | None = None
    rod_mass: Annotated[Each, ROD_MASS, RodMass] | None = None
    driven_pivot: Annotated[DrivenPivotValue, DRIVEN_PIVOT, DrivenPivot] | None = None
    drive_torque: Annotated[DriveTorqueValue, DRIVE_TORQUE, DriveTorque] | None = None
    armature: Annotated[Each, ARMATURE, Armature] | None = None

    def __post_init__(self) -> None:
        for name, (allowed, _) in _kinds().items():
            value = getattr(self, name)
            if value is None:
                continue
            try:
                object.__setattr__(self, name, allowed.read(value))
            except InputError as error:
                raise InputError(f"{name}: {error}") from None
            except ValueError as error:
                raise InputError(f"{name} is {show(value)}; allowed: {error}") from None

    def named(self) -> tuple[str, ...]:
        """The names of the effects that the scene calls for."""
        return tuple(field.name for field in dataclasses.fields(self) if getattr(self, field.name) is not None)

    def only(self, *names: str) -> Effects:
        """These effects and no others, but for those that they modify."""
        kept = {*names, *map(_modified, names)}
        return Effects(**{name: getattr(self, name) for name in self.named() if name in kept})

    def without(self, *names: str) -> Effects:
        """All effects but these, and but for those that modify them."""
        kept = [name for name in self.named() if name not in names and _modified(name) not in names]
        return Effects(**{name: getattr(self, name) for name in kept})

    def terms(self, n: int) -> dict[str, Term]:
        """What acts on a chain of n links, by name: the effects named but for those whose numbers are all 0. Read-only.

        Raises `InputError` where an effect does not fit a chain of n links, or modifies one that is not there.
        """
        terms = {name: self._term(name, n) for name in self.named()}
        for number in (number for term in terms.values() for number in cast("tuple[Any, ...]", term)):
            if isinstance(number, np.ndarray):
                number.setflags(write=False)
        acting = {name for name, term in terms.items() if not term.is_nothing()}
        return {name: term for name, term in terms.items() if {name, _modified(name) or name} <= acting}

    def _term(self, name: str, n: int) -> Term:
        other = _modified(name)
        if other is not None and getattr(self, other) is None:
            raise InputError(f"{name} does nothing without {other}; allowed: {name} beside {other}")
        modifiers = {key: getattr(self, key) for key in self.named() if _modified(key) == name}
        return cast(Term, _kinds()[name][1].of(getattr(self, name), n, **modifiers))


def names() -> tuple[str, ...]:
    """The names of all effects there are."""
    return tuple(_kinds())


def examples() -> dict[str, Any]:
    """A value of each effect that shows, by name: see `Term.example`."""
    return {name: term.example() for name, (_, term) in _kinds().items()}


def term_classes() -> tuple[type[Any], ...]:
    """The classes of their terms."""
    return tuple(term for _, term in _kinds().values())


def _modified(name: str) -> str | None:
    """The effect that this one modifies."""
    kind = _kinds()[name][1]
    return cast(str, kind.modifies()) if hasattr(kind, "modifies") else None


@cache
def _kinds() -> dict[str, tuple[Any, type[Any]]]:
    """What reads each effect's value, and the class of its term."""
    hints = get_type_hints(Effects, include_extras=True)
    return {field.name: get_args(hints[field.name])[0].__metadata__ for field in dataclasses.fields(Effects)}
