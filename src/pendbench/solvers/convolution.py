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

Kernel = Callable[[FloatArray, FloatArray, int, int, FloatArray], None]

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
    """For `lanes` products, a multiple of `WIDTH`, the kernel that adds up their inner terms.

    It is `inner(left, right, i, k, out)`: write the sum of `left[i, j] right[i, k - j]` over j = 1 .. k - 1 into
    `out[i]`; left and right are (count, orders, lanes), out (count, lanes). The outer terms, j = 0 and j = k, hold what
    is not yet known, and are the caller's. Orders that have only just been written are read last, so that the sums
    of one order begin while the order before is being finished.
    """
    registers = lanes // WIDTH

    @intrinsic
    def inner(typingctx: Any, left: Any, right: Any, i: Any, k: Any, out: Any) -> Any:  # noqa: ARG001
        def generate(context: Any, builder: ir.IRBuilder, signature: Any, args: Sequence[Any]) -> Any:
            arrays = {at: context.make_array(signature.args[at])(context, builder, args[at]) for at in (0, 1, 4)}
            left_rows, right_rows = (_Rows(builder, arrays[at], args[2], registers) for at in (0, 1))
            sums = _inner_terms(builder, left_rows, right_rows, args[3])
            target = _vectors(builder, arrays[4].data, builder.mul(args[2], args[2].type(lanes)), registers)
            for value, pointer in zip(sums, target, strict=True):
                builder.store(value, pointer, align=8)
            return context.get_dummy_value()

        return types.void(left, right, i, k, out), generate

    return cast(Kernel, inner)


def _vectors(builder: ir.IRBuilder, data: ir.Value, offset: ir.Value, registers: int) -> list[ir.Value]:
    first = builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())
    return [builder.gep(first, [offset.type(at)]) for at in range(registers)]


class _Rows:
    """The rows of orders `array[i]` in the code being generated."""

    def __init__(self, builder: ir.IRBuilder, array: Any, i: ir.Value, registers: int) -> None:
        orders, lanes = cgutils.unpack_tuple(builder, array.shape)[1:]
        self._builder, self._data, self._registers, self._lanes = builder, array.data, registers, lanes
        self._first = builder.mul(i, orders)

    def load(self, order: ir.Value) -> list[ir.Value]:
        """The registers of one order."""
        offset = self._builder.mul(self._builder.add(self._first, order), self._lanes)
        pointers = _vectors(self._builder, self._data, offset, self._registers)
        return [self._builder.load(pointer, align=8) for pointer in pointers]


def _inner_terms(builder: ir.IRBuilder, left: _Rows, right: _Rows, k: ir.Value) -> list[ir.Value]:
    one, two = k.type(1), k.type(2)
    last = builder.sub(k, one)
    sums = [cgutils.alloca_once_value(builder, _VECTOR([0.0] * WIDTH)) for _ in left.load(one)]

    def add_term(j: ir.Value, other: ir.Value) -> None:
        for total, x, y in zip(sums, left.load(j), right.load(other), strict=True):
            product = builder.fmul(x, y, flags=_ONCE)
            builder.store(builder.fadd(product, builder.load(total), flags=_ONCE), total)

    with cgutils.for_range_slice(builder, two, last, one) as (j, _):
        add_term(j, builder.sub(k, j))
    with builder.if_then(builder.icmp_signed(">", k, one)):
        add_term(one, last)
    with builder.if_then(builder.icmp_signed(">", k, two)):
        add_term(last, one)
    return [builder.load(total) for total in sums]
