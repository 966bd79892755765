"""Products of Taylor series, several at once: each pair of factors has a lane of a vector register.

The term of order k of a product is a sum over all lower orders of both factors, and a step of Taylor's method is little
else. The sums of one product are too short to be worth a vector, but those of four products side by side fill one. The
compiler does not find that by itself, so it is written out here in its own language.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba.core import cgutils as numba_cgutils
from numba.core import types
from numba.extending import intrinsic

from pendbench.base.arrays import FloatArray

cgutils: Any = numba_cgutils  # has no types

#: How many doubles make a vector: 256 bits, which every processor of the last ten years has.
WIDTH = 4

Kernel = Callable[[FloatArray, FloatArray, int, int, FloatArray, int, int], None]

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_ONCE = ("contract",)  # a product and a sum are rounded once
_LINE = 8  # doubles in a line of the cache


def factors(count: int, orders: int, lanes: int) -> FloatArray:
    """Room for the series (count, orders, lanes) on one side of the products, where no vector straddles two lines."""
    size = count * orders * lanes
    room = np.zeros(size + _LINE)
    start = -room.ctypes.data // room.itemsize % _LINE
    return room[start : start + size].reshape(count, orders, lanes)


def convolution(lanes: int) -> Kernel:
    """For `lanes` products, a multiple of `WIDTH`, the kernel that adds up their inner terms, two orders at a time.

    Half of what the sums of an order cost is to read the factors, and those of the next are made of the same numbers.
    `inner(left, right, i, k, sums, even, odd)` leaves the sum of `left[i, j] right[i, k - j]` over j = 1 .. k - 1 in
    `sums[even]`, where k is even, or in `sums[odd]`. For an even order it writes what is known of the next one, the
    terms from j = 2 on, into `sums[odd]`, and for that one it adds the rest: so the orders have to come in turn. left
    and right are (count, orders, lanes), sums (rows, lanes). The outer terms, j = 0 and j = k, hold what is not yet
    known, and are the caller's.
    """

    @intrinsic
    def inner(typingctx: Any, left: Any, right: Any, i: Any, k: Any, sums: Any, even: Any, odd: Any) -> Any:  # noqa: ARG001
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Sequence[Any]) -> Any:
            arrays = [context.make_array(signature.args[at])(context, builder, args[at]) for at in (0, 1, 4)]
            x, y = (_Factors(builder, side, args[2], lanes) for side in arrays[:2])
            own, ahead = (_Sums(builder, arrays[2].data, row, lanes) for row in args[5:])
            k = args[3]
            with builder.if_else(builder.trunc(k, ir.IntType(1))) as (is_odd, is_even):
                with is_odd:
                    _add_rest(builder, x, y, k, ahead)
                with is_even:
                    _add_two_orders(builder, x, y, k, own, ahead)
                    own.write()
            ahead.write()
            return context.get_dummy_value()

        return types.void(left, right, i, k, sums, even, odd), generate

    return cast(Kernel, inner)


def _vectors(builder: ir.IRBuilder, data: ir.Value, offset: ir.Value, lanes: int) -> list[ir.Value]:
    first = builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())
    return [builder.gep(first, [offset.type(at)]) for at in range(lanes // WIDTH)]


class _Factors:
    """The orders of factors `array[i]` in the code being generated."""

    def __init__(self, builder: ir.IRBuilder, array: Any, i: ir.Value, lanes: int) -> None:
        orders = cgutils.unpack_tuple(builder, array.shape)[1]
        self._builder, self._data, self._lanes = builder, array.data, lanes
        self._first = builder.mul(i, orders)

    def load(self, order: ir.Value) -> list[ir.Value]:
        """The registers of one order."""
        offset = self._builder.mul(self._builder.add(self._first, order), order.type(self._lanes))
        return [self._builder.load(at, align=8) for at in _vectors(self._builder, self._data, offset, self._lanes)]


class _Sums:
    """Sums in registers, which end as `array[i]`."""

    def __init__(self, builder: ir.IRBuilder, data: ir.Value, i: ir.Value, lanes: int) -> None:
        self._builder = builder
        self._rows = _vectors(builder, data, builder.mul(i, i.type(lanes)), lanes)
        self._totals = [cgutils.alloca_once_value(builder, _VECTOR([0.0] * WIDTH)) for _ in self._rows]

    def add(self, left: Sequence[ir.Value], right: Sequence[ir.Value]) -> None:
        """The products of two orders."""
        for total, x, y in zip(self._totals, left, right, strict=True):
            product = self._builder.fmul(x, y, flags=_ONCE)
            self._builder.store(self._builder.fadd(product, self._builder.load(total), flags=_ONCE), total)

    def take_up(self) -> None:
        """Go on from what is in the array."""
        for total, row in zip(self._totals, self._rows, strict=True):
            self._builder.store(self._builder.load(row, align=8), total)

    def write(self) -> None:
        """Write them into the array."""
        for total, row in zip(self._totals, self._rows, strict=True):
            self._builder.store(self._builder.load(total), row, align=8)


def _add_two_orders(
    builder: ir.IRBuilder, left: _Factors, right: _Factors, k: ir.Value, own: _Sums, ahead: _Sums
) -> None:
    """Of an even order. What has only just been written is read last, so that sums begin while that is finished."""
    one, two, three = k.type(1), k.type(2), k.type(3)
    last, but_one = builder.sub(k, one), builder.sub(k, two)
    with builder.if_else(builder.icmp_signed("==", k, two)) as (is_two, is_more):
        with is_two:
            own.add(left.load(one), right.load(one))
        with is_more:
            before = right.load(but_one)
            own.add(left.load(two), before)
            kept = [cgutils.alloca_once_value(builder, register) for register in before]
            with cgutils.for_range_slice(builder, three, last, one) as (j, _):
                x, y = left.load(j), right.load(builder.sub(k, j))
                own.add(x, y)
                ahead.add(x, [builder.load(register) for register in kept])
                for register, value in zip(kept, y, strict=True):
                    builder.store(value, register)
            recent = right.load(last)
            own.add(left.load(one), recent)
            ahead.add(left.load(two), recent)
            recent = left.load(last)
            own.add(recent, right.load(one))
            ahead.add(recent, right.load(two))


def _add_rest(builder: ir.IRBuilder, left: _Factors, right: _Factors, k: ir.Value, ahead: _Sums) -> None:
    """Of an odd order, which has no inner terms where it is 1."""
    one = k.type(1)
    last = builder.sub(k, one)
    with builder.if_then(builder.icmp_signed(">", k, one)):
        ahead.take_up()
        ahead.add(left.load(one), right.load(last))
        ahead.add(left.load(last), right.load(one))
