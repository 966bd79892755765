"""Columns and tables: a column is declared once, in the folder of its kind, with its unit, meaning and value.

CSV files, Markdown tables, the terminal and the documentation follow these declarations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any, Final

import numpy as np

from pendbench.report.numbers import NOTHING, is_missing, number_text

Value = Callable[[Any], Any]


@dataclass(frozen=True)
class Column:
    """unit: empty for text. format: how people read a number: "" text, "d" whole, ".3g" digits, ".1e", ".0%".

    heading: for tables. meaning: one sentence. of: the value of a row; the row's attribute of the column's name by
    default. is_time: whether it depends on the clock and so differs from run to run, on the same machine; all the
    others can be reproduced. empty: what people read where there is no number.
    """

    name: str
    unit: str
    format: str
    heading: str
    meaning: str
    of: Value | None = None
    is_time: bool = False
    empty: str = NOTHING

    def at(self, of: Value, meaning: str = "") -> Column:
        """The same column in a table whose rows keep the value elsewhere, or mean it more narrowly."""
        return replace(self, of=of, meaning=meaning or self.meaning)

    def without(self, why: str) -> Column:
        """The same column in a table that has it because every kind has it, and no value for it."""
        return self.at(lambda _: math.nan, f"empty: {why}")

    def value(self, row: Any) -> Any:
        """The value of a row."""
        return getattr(row, self.name) if self.of is None else self.of(row)

    def text(self, row: Any) -> str:
        """The value for people. Text comes as it is: whoever writes it escapes it."""
        return self.shown(self.value(row))

    def shown(self, value: Any) -> str:
        """A number of this column for people."""
        if is_missing(value):
            return self.empty
        return value if isinstance(value, str) else number_text(value, self.format or ".4g")

    def stored(self, row: Any) -> str | int | float:
        """The value for a CSV file: numbers to the last digit, nothing where there is none, text as it is."""
        value = self.value(row)
        if is_missing(value):
            return ""
        if isinstance(value, (bool, np.bool_)):
            return "true" if value else "false"
        if isinstance(value, (int, np.integer)):
            return int(value)
        return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


@dataclass(frozen=True)
class Floored(Column):
    """A column whose values are not told from 0 below a floor: people read ``< 1e-9`` then. floor: of a row."""

    floor: Value = lambda _: math.nan

    def text(self, row: Any) -> str:
        """The value for people."""
        floor = self.floor(row)
        return f"< {self.shown(floor)}" if self.value(row) < floor else super().text(row)


@dataclass(frozen=True)
class Table:
    """Rows of one type and their columns, in the order in which they are written. name: of its CSV file."""

    name: str
    columns: tuple[Column, ...]
    rows: Sequence[Any]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    def column(self, name: str) -> Column:
        """The column of that name. Raises KeyError where there is none."""
        found = next((column for column in self.columns if column.name == name), None)
        if found is None:
            raise KeyError(f"table {self.name} has no column {name}")
        return found

    def text(self, row: Any, name: str) -> str:
        """A value of a row for people."""
        return self.column(name).text(row)

    def of(self, rows: Iterable[Any]) -> Table:
        """A table of some of the rows."""
        return replace(self, rows=list(rows))


def text_column(name: str, heading: str, meaning: str, of: Value | None = None, *, is_time: bool = False) -> Column:
    """A column of text."""
    return Column(name, "", "", heading, meaning, of, is_time, "")


def tables_of(columns: Mapping[str, tuple[Column, ...]], rows: Mapping[str, Iterable[Any]]) -> tuple[Table, ...]:
    """A table of each name, in the order of the rows."""
    return tuple(Table(name, columns[name], list(own)) for name, own in rows.items())


def within(part: str, *columns: Column) -> tuple[Column, ...]:
    """Columns whose values a row keeps, by their names, in a part of it."""
    return tuple(replace(column, of=attrgetter(f"{part}.{column.name}")) for column in columns)


def energy_drift(part: str, largest: str = "energy_drift_max") -> tuple[Column, Column]:
    """The energy's drift, and how well it is known, which are in a part of the row."""
    its, floor = ENERGY_DRIFT_MAX, attrgetter(f"{part}.energy_floor")
    drift = attrgetter(f"{part}.{largest}")
    return Floored(its.name, its.unit, its.format, its.heading, its.meaning, drift, floor=floor), ENERGY_FLOOR.at(floor)


SCENE_NAME: Final = text_column("scene", "scene", "the scene's name", lambda row: row.case.scene.name)
N: Final = Column("n", "1", "d", "n", "links of the chain", lambda row: row.case.scene.n)
ENGINE: Final = text_column("engine", "engine", "the program that simulated", lambda row: row.case.engine)
METHOD: Final = text_column(
    "method", "method", "one way in which the engine advances time", lambda row: row.case.method
)
DT: Final = Column(
    "dt", "s", ".3g", "step, s", "the step; empty for a method that chooses its own", lambda row: row.case.dt,
    empty="its own",
)  # fmt: skip
SETTINGS: Final = text_column(
    "settings", "settings", "settings of the method that the study gives it", lambda row: row.case.settings_text
)
#: What every row of a case begins with; the row has its `case`.
CASE: Final = (SCENE_NAME, N, ENGINE, METHOD, DT, SETTINGS)
#: How a row ended.
ENDING: Final = (
    text_column("status", "status", "how it ended"),
    text_column("reason", "reason", "why, where it did not end well"),
)
#: What a scene's row begins with; the row has its `scene`.
SCENE: Final = (SCENE_NAME.at(lambda row: row.scene.name), N.at(lambda row: row.scene.n))
DURATION: Final = Column(
    "duration_s", "s", ".3g", "duration, s", "how long the scene lasts", lambda row: row.scene.duration
)
TITLE: Final = text_column("title", "title", "what the scene is, in its own words", lambda row: row.scene.title)
HORIZON: Final = Column(
    "horizon_s", "s", ".3g", "horizon, s", "until when the reference is known; nothing is compared past it"
)
REFERENCE_ERROR: Final = Column(
    "reference_error", "L", ".1e", "reference error", "how far the reference may be from the truth up to its horizon"
)
ERROR_MAX: Final = Column(
    "error_max", "L", ".1e", "e max", "the largest e(t) up to the horizon, or to where the run ended"
)
ANGLE_ERROR_MAX: Final = Column(
    "angle_error_max_rad", "rad", ".1e", "angle error", "the largest error of any angle, wrapped"
)
ENERGY_DRIFT_MAX: Final = Column(
    "energy_drift_max", "energy scale", ".1e", "energy drift",
    "the largest deviation of the energy (less the work of what damps and drives) from its first value at any sample "
    "of the whole run",
)  # fmt: skip
ENERGY_FLOOR: Final = Column(
    "energy_floor", "energy scale", ".0e", "known to",
    "how well the work of what damps and drives is known: an energy drift below this is not told from 0; empty where "
    "nothing does",
)  # fmt: skip
ENERGY_BAND: Final = Column(
    "energy_drift_band", "energy scale", ".1e", "band", "the energy's largest value less its smallest one"
)
ENERGY_SLOPE: Final = Column(
    "energy_drift_slope_per_s", "energy scale/s", ".1e", "drift per s",
    "the slope of a least-squares line through the energy: near zero for a method that keeps it in a band",
)  # fmt: skip
GAP_MAX: Final = Column(
    "gap_max", "1", ".1e", "joint gap",
    "how far the worst rod was from its length, over that length; 0 for engines that work in angles",
)  # fmt: skip
STEPS: Final = Column("steps", "1", "d", "steps", "steps that the run took")
ORDER_CLAIMED: Final = Column(
    "order_claimed", "1", "d", "order claimed", "the method's order by its makers", empty="adaptive"
)
ORDER_OBSERVED: Final = Column(
    "order_observed", "1", ".2f", "order observed", "the order with which the error falls between two steps"
)
#: The steps that show an order, and where the error stops falling.
ORDER_DT_COARSE: Final = Column(
    "order_dt_coarse", "s", ".3g", "from step, s", "the coarser of the two steps that show the order"
)
ORDER_DT_FINE: Final = Column(
    "order_dt_fine", "s", ".3g", "to step, s", "the finer of the two steps that show the order"
)
PLATEAU: Final = Column(
    "plateau", "L", ".1e", "plateau", "the error below which smaller steps do not bring it", empty="none"
)
TOLERANCE: Final = Column("tolerance", "1", ".1e", "tolerance", "the tolerance of a method that chooses its steps")
MODEL_ERROR: Final = Column(
    "model_error", "1", ".1e", "model error",
    "how far the engine's accelerations are from the equations', over the largest acceleration",
    lambda row: row.model.error,
)  # fmt: skip
#: The lengths that a growth with n is fitted to.
N_FROM: Final = Column("n_from", "1", "d", "from n", "the fewest links that the exponent is fitted to")
N_TO: Final = Column("n_to", "1", "d", "to n", "the most links that the exponent is fitted to")
#: A sample of a curve.
TIME: Final = Column("t_s", "s", ".4g", "t, s", "time")
ENERGY_ERROR: Final = Column(
    "energy_error", "energy scale", ".1e", "energy error", "deviation of the energy from its first value"
)
STEP_US: Final = Column("step_us", "us", ".3g", "step, µs", "the median cost of a step", is_time=True)
STEP_SPREAD: Final = Column(
    "step_spread", "1", ".0%", "spread", "largest less smallest sample of the step's cost, over the median",
    is_time=True,
)  # fmt: skip
SIMULATED: Final = Column(
    "simulated_s_per_s", "s/s", ".3g", "simulated s/s", "simulated time per time spent stepping", is_time=True
)
BUILD: Final = Column("build_s", "s", ".2g", "build, s", "building the run", is_time=True)
FIRST_CALL: Final = Column(
    "first_call_s", "s", ".2g", "first call, s", "the first step of all, with what is compiled or loaded then",
    is_time=True,
)  # fmt: skip
RUN: Final = Column("run_s", "s", ".3g", "run, s", "time spent stepping up to the horizon", is_time=True)
#: What a case costs; the row has its `timing`.
TIMING: Final = within("timing", STEP_US, STEP_SPREAD, SIMULATED, BUILD, FIRST_CALL, RUN)
FLAGS: Final = text_column(
    "flags", "flags", "what a reader should know about the row, its timing included", is_time=True
)
