"""The laws of all the effects of a scene, summed in a kernel as if they were written out there.

The terms come as a tuple. Its type says which effects there are, so numba compiles the sum for just these; a sum over
no effects is a constant.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pendbench.base.compiled import chosen_by_type, inlined
from pendbench.effects import term_classes


def _law(name: str, terms: Any) -> Any:
    """The law of the first of the terms, by their numba type, ready to be called in a kernel; None if it has none."""
    return _LAWS[name].get(terms[0].instance_class)


_NAMES = ("pivot_acceleration", "pivot_velocity", "joint_torque", "drag", "drive")
_LAWS = {
    name: {term: inlined(getattr(term, name)) for term in term_classes() if hasattr(term, name)} for name in _NAMES
}


def pivot_acceleration(terms: Any, t: Any) -> tuple[Any, Any]:
    """(x, y) m/s^2, the sum over the terms."""
    raise NotImplementedError


def pivot_velocity(terms: Any, t: Any) -> tuple[Any, Any]:
    """(x, y) m/s, the sum over the terms."""
    raise NotImplementedError


def drives(terms: Any, t: Any) -> tuple[Any, ...]:
    """What each term's law gets of the time t s."""
    raise NotImplementedError


def joint_torque(terms: Any, drives: Any, i: int, bend: Any, rate: Any) -> Any:
    """N m, the sum over the terms, for joint i bent by bend rad at rate rad/s."""
    raise NotImplementedError


def drag(terms: Any, i: int, x: Any, y: Any) -> tuple[Any, Any]:
    """(x, y) N, the sum over the terms, for mass i at velocity (x, y) m/s through the air."""
    raise NotImplementedError


def _vector_sum(generic: Callable[..., Any], name: str) -> None:
    """Two components, summed over the terms that have the law, for laws of one argument besides the term."""

    def choose(terms: Any, t: Any) -> Any:  # noqa: ARG001
        if len(terms) == 0:
            return lambda terms, t: (0.0, 0.0)  # noqa: ARG005
        law = _law(name, terms)
        if law is None:
            return lambda terms, t: generic(terms[1:], t)
        if len(terms) == 1:
            return lambda terms, t: law(terms[0], t)

        def total(terms: Any, t: Any) -> Any:
            x, y = law(terms[0], t)
            others_x, others_y = generic(terms[1:], t)
            return x + others_x, y + others_y

        return total

    chosen_by_type(generic)(choose)


_vector_sum(pivot_acceleration, "pivot_acceleration")
_vector_sum(pivot_velocity, "pivot_velocity")


@chosen_by_type(drives)
def _choose_drives(terms: Any, t: Any) -> Any:  # noqa: ARG001
    if len(terms) == 0:
        return lambda terms, t: ()  # noqa: ARG005
    law = _law("drive", terms)
    if law is None:
        return lambda terms, t: (0.0,) + drives(terms[1:], t)  # noqa: RUF005
    return lambda terms, t: (law(terms[0], t),) + drives(terms[1:], t)  # noqa: RUF005


@chosen_by_type(joint_torque)
def _choose_joint_torque(terms: Any, drives: Any, i: Any, bend: Any, rate: Any) -> Any:  # noqa: ARG001
    if len(terms) == 0:
        return lambda terms, drives, i, bend, rate: 0.0  # noqa: ARG005
    law = _law("joint_torque", terms)
    if len(terms) == 1:
        return lambda terms, drives, i, bend, rate: law(terms[0], drives[0], i, bend, rate)

    def total(terms: Any, drives: Any, i: Any, bend: Any, rate: Any) -> Any:
        others = joint_torque(terms[1:], drives[1:], i, bend, rate)
        return law(terms[0], drives[0], i, bend, rate) + others

    return total


@chosen_by_type(drag)
def _choose_drag(terms: Any, i: Any, x: Any, y: Any) -> Any:  # noqa: ARG001
    if len(terms) == 0:
        return lambda terms, i, x, y: (0.0, 0.0)  # noqa: ARG005
    law = _law("drag", terms)
    if len(terms) == 1:
        return lambda terms, i, x, y: law(terms[0], i, x, y)

    def total(terms: Any, i: Any, x: Any, y: Any) -> Any:
        own_x, own_y = law(terms[0], i, x, y)
        others_x, others_y = drag(terms[1:], i, x, y)
        return own_x + others_x, own_y + others_y

    return total
