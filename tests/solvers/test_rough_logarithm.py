"""The rough logarithm against the exact one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendbench.solvers.rough_logarithm import rough_log2
from support.kernels import called

PROMISED = 1.01e-4


@pytest.mark.parametrize("exponent", [-1022, -700, -3, -1, 0, 1, 52, 1023])
def test_it_is_as_near_as_promised(exponent):
    found = called(rough_log2)
    for mantissa in np.linspace(1.0, 2.0, 2001)[:-1]:
        x = math.ldexp(mantissa, exponent)
        assert abs(found(x) - math.log2(x)) <= PROMISED, x


@pytest.mark.parametrize("x", [0.0, 5e-324, 1e-310])
def test_what_is_no_normal_number_is_below_all_that_are(x):
    assert called(rough_log2)(x) < -1022.0
