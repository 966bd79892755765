"""The classical Runge-Kutta method.

Source: Kutta 1901; Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, p. 138.
"""

from __future__ import annotations

import numpy as np

from pendbench.solvers.explicit import Tableau, runge_kutta_method
from pendbench.solvers.methods import add

RK4 = Tableau(
    a=np.array([[0, 0, 0, 0], [0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 1, 0]], dtype=float),
    b=np.array([1, 2, 2, 1]) / 6,
    c=np.array([0, 0.5, 0.5, 1]),
    order=4,
)

add(runge_kutta_method("rk4", RK4, note="the classical Runge-Kutta method"))
