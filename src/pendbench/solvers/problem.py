"""What a solver needs to know of the system it advances: nothing but its derivative.

A system is a NamedTuple of arrays and numbers. Its module says what the functions below do for it
(`compiled.specialises`), and numba compiles each solver once for each type of system, with the derivative inside.
"""

from __future__ import annotations

from typing import Any

from pendbench.base.arrays import FloatArray


def derivative(system: Any, t: float, y: FloatArray, dy: FloatArray) -> None:
    """Write dy/dt at time t (s) and state y (d,) into dy (d,)."""
    raise NotImplementedError(f"no derivative for {type(system).__name__}")


def acceleration(system: Any, t: float, q: FloatArray, v: FloatArray, a: FloatArray) -> None:
    """Write the second derivative of q (d,) at time t (s), with v (d,) its first, into a (d,)."""
    raise NotImplementedError(f"no acceleration for {type(system).__name__}")


def momentum(system: Any, q: FloatArray, v: FloatArray, p: FloatArray) -> None:
    """Write the conjugate momenta dL/dv at q (d,), v (d,) into p (d,)."""
    raise NotImplementedError(f"no momentum for {type(system).__name__}")


def velocity(system: Any, q: FloatArray, p: FloatArray, v: FloatArray) -> None:
    """Write the rates v (d,) whose conjugate momenta at q (d,) are p (d,)."""
    raise NotImplementedError(f"no velocity for {type(system).__name__}")


def generalized_force(system: Any, t: float, q: FloatArray, v: FloatArray, f: FloatArray) -> None:
    """Write dL/dq at time t (s), q (d,), v (d,) into f (d,)."""
    raise NotImplementedError(f"no generalized force for {type(system).__name__}")


def rate_series(system: Any, t: float, q: FloatArray, v: FloatArray) -> None:
    """From q (d,) and v[0] (d,) at time t (s), write the Taylor coefficients of the rates into v[1:] (order, d)."""
    raise NotImplementedError(f"no series for {type(system).__name__}")


def ensemble_derivatives(system: Any, y: FloatArray, dy: FloatArray) -> None:
    """Write dy/dt (d, lanes) of many states y (d, lanes) side by side into dy; the system must not depend on time."""
    raise NotImplementedError(f"no derivatives of an ensemble for {type(system).__name__}")
