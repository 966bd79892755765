"""What a stage shows: plain numbers and words, already computed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pendbench.base.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Body:
    """A chain that moves: at times t (k,) s its points, the pivot first, are at places (k, m, 2) m."""

    t: FloatArray
    places: FloatArray
    colour: str = ""


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity of an act: values (k,) at times t (k,) s; what is no number, or not above 0, is not drawn."""

    t: FloatArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Act:
    """One line of the legend, with the chains and the curves that it switches on and off.

    name: the engine. detail: method and step. colour: #rrggbb. dashes: of its curves, px; none for a line drawn
    through. hollow: whether its lines have a light core. leaves: when its error passes 1 % of the length, s; nan where
    it does not. ended: how it ended, where it did not end well.
    """

    name: str
    detail: str
    colour: str
    bodies: tuple[Body, ...]
    error: Curve
    energy: Curve
    dashes: tuple[float, ...] = ()
    hollow: bool = False
    leaves: float = math.nan
    ended: str = ""


@dataclass(frozen=True, eq=False)
class Truth:
    """The ghost: a body that ends at the horizon, s, the curve of how well it is known, and what is said past it."""

    body: Body
    bound: Curve
    horizon: float
    ends: str = "past here nobody knows"


@dataclass(frozen=True, eq=False)
class Stage:
    """A whole page.

    length: of the straight chain, m. error_says, energy_says: what the two curves show, as their headings. words: the
    page for those who do not see it, a sentence each. facts: what made it, as (name, value). now_says: the heading of
    what the legend tells of the error at the time shown.
    """

    title: str
    name: str
    links: int
    duration: float
    length: float
    acts: tuple[Act, ...]
    truth: Truth | None
    error_says: str
    energy_says: str
    words: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    now_says: str = "off now"


@dataclass(frozen=True, eq=False)
class FlipStage:
    """A page with a map of flip times and the pendulum that starts where it is touched.

    masses kg and lengths m: of the two links; gravity: m/s^2; duration: s. times: (size, size) s, inf where nothing
    flips, nan where that is not known; theta_1 chooses the row and theta_2 the column, from -pi to pi. start: two
    angles, rad. The rest as for `Stage`.
    """

    title: str
    name: str
    duration: float
    masses: tuple[float, float]
    lengths: tuple[float, float]
    gravity: float
    times: FloatArray
    start: tuple[float, float]
    colour: str
    words: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
