"""What the equations are evaluated with: balls, complex balls, series of balls, and any of these with derivatives.

All are python-flint's, whose operations enclose: whatever is in the operands, the result is in the result. `Dual` adds
derivatives by the chain rule and calls nothing but those operations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

#: An `arb`, an `acb` or an `arb_series`, or a `Dual` of one of them.
Number = Any


@contextmanager
def precision(bits: int, length: int = 10) -> Iterator[None]:
    """In this block balls have midpoints of so many bits, and series at most so many coefficients."""
    from flint import ctx

    before = ctx.prec, ctx.cap
    ctx.prec, ctx.cap = bits, length
    try:
        yield
    finally:
        ctx.prec, ctx.cap = before


class Dual:
    """A number with its derivatives with respect to some variables, by the variables' indices; those left out are 0."""

    __slots__ = ("slopes", "value")

    def __init__(self, value: Number, slopes: dict[int, Number]) -> None:
        self.value, self.slopes = value, slopes

    def __add__(self, other: Any) -> Dual:
        if not isinstance(other, Dual):
            return Dual(self.value + other, self.slopes)
        slopes = dict(self.slopes)
        for key, slope in other.slopes.items():
            slopes[key] = slopes[key] + slope if key in slopes else slope
        return Dual(self.value + other.value, slopes)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, {key: -slope for key, slope in self.slopes.items()})

    def __sub__(self, other: Any) -> Dual:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Dual:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> Dual:
        if not isinstance(other, Dual):
            return Dual(self.value * other, {key: slope * other for key, slope in self.slopes.items()})
        slopes = {key: slope * other.value for key, slope in self.slopes.items()}
        for key, slope in other.slopes.items():
            more = slope * self.value
            slopes[key] = slopes[key] + more if key in slopes else more
        return Dual(self.value * other.value, slopes)

    __rmul__ = __mul__


def sine_cosine(x: Number) -> tuple[Number, Number]:
    """Both of one number."""
    if isinstance(x, Dual):
        sine, cosine = sine_cosine(x.value)
        up = {key: cosine * slope for key, slope in x.slopes.items()}
        return Dual(sine, up), Dual(cosine, {key: -(sine * slope) for key, slope in x.slopes.items()})
    if hasattr(x, "sin_cos"):
        sine, cosine = x.sin_cos()
        return sine, cosine
    return x.sin(), x.cos()  # acb


def variables(values: Sequence[Number]) -> list[Dual]:
    """Each value as a variable of its own, in whose index its slope is 1."""
    return [Dual(value, {key: 1 + 0 * value}) for key, value in enumerate(values)]


def solve(matrix: Sequence[Sequence[Number]], right: Sequence[Number]) -> list[Number]:
    """Solve a symmetric system (n, n), of which the lower half is read.

    Where the matrix may be singular, the result is not finite, or flint raises ZeroDivisionError. So a finite result
    says that it is invertible, whatever is in the balls.
    """
    n = len(right)
    lower, values = [[_value(its) for its in row[: i + 1]] for i, row in enumerate(matrix)], list(map(_value, right))
    factors = _factors(lower, values)
    plain = factors(values)
    slopes: list[dict[int, Number]] = [{} for _ in range(n)]
    for key in _keys([*right, *(entry for i, row in enumerate(matrix) for entry in row[: i + 1])]):
        # A x = b, so A dx = db - dA x.
        change = [_slope(right[i], key) - _turned(matrix, plain, i, key) for i in range(n)]
        for i, found in enumerate(factors(change)):
            slopes[i][key] = found
    return [Dual(x, its) for x, its in zip(plain, slopes, strict=True)] if slopes[0] else plain


def _turned(matrix: Sequence[Sequence[Number]], x: Sequence[Number], i: int, key: int) -> Number:
    """Entry i of the matrix's derivative times x."""
    lower = ((matrix[max(i, j)][min(i, j)], x[j]) for j in range(len(x)))
    return sum((entry.slopes[key] * its for entry, its in lower if isinstance(entry, Dual) and key in entry.slopes), 0)


def _value(x: Number) -> Number:
    return x.value if isinstance(x, Dual) else x


def _slope(x: Number, key: int) -> Number:
    return x.slopes.get(key, 0) if isinstance(x, Dual) else 0


def _keys(entries: Sequence[Number]) -> list[int]:
    return sorted({key for entry in entries if isinstance(entry, Dual) for key in entry.slopes})


def _factors(lower: list[list[Number]], right: list[Number]) -> Callable[[Sequence[Number]], list[Number]]:
    """What solves with a symmetric matrix, of which the lower half is given, for right sides of this kind."""
    kinds = {type(entry).__name__ for row in (*lower, right) for entry in row}
    return _Eliminated(lower).solve if "arb_series" in kinds else _Preconditioned(lower, "acb" in kinds).solve


class _Preconditioned:
    """A matrix of balls, which may be wide: multiplied by the inverse of its middle first, by flint."""

    def __init__(self, lower: list[list[Number]], is_complex: bool) -> None:
        from flint import acb_mat, arb_mat

        n = len(lower)
        self._kind: Any = acb_mat if is_complex else arb_mat
        self._matrix = self._kind([[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)])

    def solve(self, right: Sequence[Number]) -> list[Number]:
        """The solution."""
        found = self._matrix.solve(self._kind([[its] for its in right]), algorithm="precond")
        return list(found.entries())


class _Eliminated:
    """A matrix of series, eliminated from its last row up."""

    def __init__(self, lower: list[list[Number]]) -> None:
        n = len(lower)
        rest = [list(row) for row in lower]
        self._inverse: list[Number] = [None] * n
        self._factors: list[list[Number]] = [[] for _ in range(n)]
        for k in reversed(range(n)):
            self._inverse[k] = 1 / rest[k][k]
            self._factors[k] = [rest[k][i] * self._inverse[k] for i in range(k)]
            for i, factor in enumerate(self._factors[k]):
                for j in range(i + 1):
                    rest[i][j] = rest[i][j] - factor * rest[k][j]

    def solve(self, right: Sequence[Number]) -> list[Number]:
        """The solution."""
        b, n = list(right), len(right)
        for k in reversed(range(n)):
            for i, factor in enumerate(self._factors[k]):
                b[i] = b[i] - factor * b[k]
        x: list[Number] = []
        for k in range(n):
            x.append(self._inverse[k] * b[k] - sum((f * its for f, its in zip(self._factors[k], x, strict=True)), 0))
        return x
