"""Balls as text that reads back to the last bit, and as doubles that enclose."""

from __future__ import annotations

import math

from pendbench.base.errors import InputError
from pendbench.truth.proof.numbers import Number, precision

_SPARE = 16


def ball_text(ball: Number) -> str:
    """``m:e:r:f``, four whole numbers in base 16, for the ball m 2^e +- r 2^f."""
    numbers = (*ball.mid().man_exp(), *ball.rad().man_exp())
    return ":".join(f"{int(number):x}" for number in numbers)


def read_ball(text: str) -> Number:
    """The ball. Raises `InputError` where the text is none."""
    from flint import arb

    try:
        m, e, r, f = (int(part, 16) for part in text.split(":"))
    except ValueError:
        raise InputError(f"{text[:40]!r} is no ball; allowed: m:e:r:f, in base 16, for m 2^e +- r 2^f") from None
    return arb((m, e), (r, f))


def trimmed(ball: Number) -> Number:
    """A ball that holds this one, without the digits of its midpoint that its radius says nothing of."""
    if ball.rad().is_zero():
        return ball
    with precision(max(ball.rel_accuracy_bits(), 0) + _SPARE):
        return ball + 0


def outwards(ball: Number) -> tuple[float, float]:
    """Midpoint and radius as doubles, such that all of the ball is within the radius of the midpoint."""
    with precision(128):
        middle = float(ball.mid())
        left_out = (ball - middle).abs_upper()
        radius = float(left_out)
        while radius < left_out:
            radius = math.nextafter(radius, math.inf)
    return middle, radius
