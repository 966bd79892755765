"""The motion of a single pendulum as a Taylor series in time: `series` has the chains.

Nothing hangs on its rod, so two products are left, (E69), and an order waits for the one before the last only. They are
so short that the loops around them would take as long as they do, so all orders are written out, one after another, in
the compiler's own language: they stay in registers, and the code is left at the order that is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined
from pendbench.scene.scene import Scene
from pendbench.solvers.trigonometry import direction

#: The highest order that is written out; the smallest tolerance that the engine takes needs 18.
HIGHEST = 20

Kernel = Callable[[FloatArray, float, int], None]

_ONCE = ("contract",)  # a product and a sum are rounded once


class SingleSystem(NamedTuple):
    """A pendulum with one rod. pull: -g/l, 1/s^2."""

    pull: float


def single_system_of(scene: Scene, order: int) -> SingleSystem:
    """The scene's pendulum under gravity or free of it. Raises ValueError where the order is above `HIGHEST`."""
    if order > HIGHEST:
        raise ValueError(f"a series of order {order}; allowed: up to {HIGHEST}")
    return SingleSystem(-(scene.effects.gravity or 0.0) / float(scene.lengths[0]))


class _Sums:
    """Sums of products in the code being generated."""

    def __init__(self, builder: ir.IRBuilder) -> None:
        self._builder = builder

    def scaled(self, factor: float, value: ir.Value) -> ir.Value:
        """A number times a value."""
        return self._builder.fmul(ir.Constant(ir.DoubleType(), factor), value, flags=_ONCE)

    def of(self, pairs: Sequence[tuple[ir.Value, ir.Value]]) -> ir.Value:
        """The sum of the pairs' products, in two halves: while one waits for a product, the other goes on."""
        halves = [self._in_a_row(half) for half in (pairs[::2], pairs[1::2]) if half]
        return halves[0] if len(halves) == 1 else self._builder.fadd(*halves, flags=_ONCE)

    def _in_a_row(self, pairs: Sequence[tuple[ir.Value, ir.Value]]) -> ir.Value:
        total, *others = (self._builder.fmul(x, y, flags=_ONCE) for x, y in pairs)
        for product in others:
            total = self._builder.fadd(total, product, flags=_ONCE)
        return total


def _stiffness(sums: _Sums, omega: Sequence[ir.Value], k: int) -> ir.Value:
    """Order k > 0 of -g/l cos(theta): half a square, in which each product but that of the middle is there twice."""
    pairs = [(omega[j], omega[k - j]) for j in range((k + 1) // 2)]
    if k % 2 == 0:
        pairs.append((sums.scaled(0.5, omega[k // 2]), omega[k // 2]))
    return sums.scaled(-1.0, sums.of(pairs))


@intrinsic
def _orders(typingctx: Any, rates: Any, stiffness: Any, last: Any) -> Any:  # noqa: ARG001
    """From orders 0 and 1 of rates (last + 1, 1) and order 0 of the stiffness, write those from 2 to `last`."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Sequence[Any]) -> Any:
        data, sums = context.make_array(signature.args[0])(context, builder, args[0]).data, _Sums(builder)
        at = [builder.gep(data, [ir.Constant(args[2].type, k)]) for k in range(HIGHEST + 1)]
        omega, q = [builder.load(at[0]), builder.load(at[1])], [args[1]]
        done = builder.append_basic_block("done")
        for k in range(HIGHEST - 1):
            further = builder.append_basic_block(f"order_{k + 2}")
            builder.cbranch(builder.icmp_signed("<", args[2], args[2].type(k + 2)), done, further)
            builder.position_at_end(further)
            if k > 0:
                q.append(_stiffness(sums, omega, k))
            # What has only just been written comes last, so that the rest need not wait for it.
            pairs = [(q[j], omega[k - j]) for j in (*range(1, k), *sorted({0, k}))]
            omega.append(sums.scaled(1.0 / ((k + 1) * (k + 2)), sums.of(pairs)))
            builder.store(omega[-1], at[k + 2])
        builder.branch(done)
        builder.position_at_end(done)
        return context.get_dummy_value()

    return types.void(rates, stiffness, last), generate


_write_orders = cast(Kernel, _orders)


@inlined
def write_rate_series(s: SingleSystem, t: float, theta: FloatArray, omega: FloatArray) -> None:  # noqa: ARG001
    """From theta (1,) and omega[0] (1,), write the Taylor coefficients omega[1:] (order, 1), rad/s^(k + 1).

    Source: docs/equations.md, (E69).
    """
    c, sine = direction(theta[0])
    omega[1, 0] = s.pull * sine
    _write_orders(omega, s.pull * c, len(omega) - 1)
