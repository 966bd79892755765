"""The keys of a scene file, and the scene that they describe."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from pendbench.arrays import FloatArray
from pendbench.bundled import bundled, bundled_names
from pendbench.errors import InputError, choose, printable
from pendbench.scene import ANGLE, DURATION, LENGTH, MASS, MAX_LINKS, RATE, Effects, Scene, disagreement
from pendbench.strict import input_error, read_toml, show, shown_path, validate

Mass = Annotated[float, MASS]
Length = Annotated[float, LENGTH]
Angle = Annotated[float, ANGLE]
Rate = Annotated[float, RATE]


def one_line_title(text: str) -> str:
    if not (text.isprintable() and 1 <= len(text) <= 200):
        raise ValueError("one line of 1 to 200 characters")
    return text


class Table(BaseModel):
    """A table whose every key is known and whose every value has its type: no text for a number, no number for text."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Chain(Table):
    """[chain]: `masses` or `mass`, `lengths` or `length`, and `n`.

    A list has one entry for each link; a number is meant for every link. The two can be mixed: a list of masses with
    one length is a chain of equal rods. `n` is needed where there is no list, and must agree with any list there is.
    """

    n: Annotated[int, Field(ge=1, le=MAX_LINKS)] | None = None
    mass: Mass | None = None
    masses: Annotated[list[Mass], Field(min_length=1)] | None = None
    length: Length | None = None
    lengths: Annotated[list[Length], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        for one, each in (("mass", "masses"), ("length", "lengths")):
            given = [key for key in (one, each) if getattr(self, key) is not None]
            if not given:
                raise InputError(f"missing '{each}', one for each link, or '{one}', one number for all")
            if len(given) == 2:
                raise InputError(f"both {one} and {each} are given; allowed: one of them")
        if not self.counts():
            raise InputError("missing key 'n': how many links, where neither masses nor lengths is a list")
        (key, count), *others = self.counts()
        for other, other_count in others:
            if other_count != count:
                raise InputError(disagreement(key, count, other, other_count))
        return self

    def counts(self) -> list[tuple[str, int]]:
        """The keys that say how many links there are, each with what it says."""
        lists = [(key, len(getattr(self, key))) for key in ("masses", "lengths") if getattr(self, key) is not None]
        return lists if self.n is None else [("n", self.n), *lists]


class Start(Table):
    """[start]: one number for every link, or a list with one for each. Without `rates` the chain starts at rest."""

    angles: Angle | list[Angle]
    rates: Rate | list[Rate] = 0.0


class SceneFile(Table):
    """A scene file. Without a `title` the scene's name is its title; an effect that is not named does not act."""

    title: Annotated[str, AfterValidator(one_line_title)] | None = None
    duration: Annotated[float, DURATION]
    chain: Chain
    start: Start
    effects: Effects = Effects()


def find_scene(path_or_name: str | os.PathLike[str], relative_to: Path | None = None) -> Path:
    """The file of a scene that is given as `load_scene` takes it."""
    try:
        text = os.fsdecode(path_or_name)
    except TypeError:
        raise InputError(f"{show(path_or_name)} is neither the name of a scene nor a path") from None
    if not (text.lower().endswith(".toml") or "/" in text or os.sep in text):
        if text not in bundled_names("models"):
            unknown = choose("scene", printable(text[:60]), bundled_names("models"))
            raise InputError(f"{unknown}, or a path that ends in .toml")
        return bundled("models") / f"{text}.toml"
    if relative_to is None or os.path.isabs(text):
        return Path(text)
    for path in (Path(relative_to, text), Path(text)):
        if os.path.lexists(path):
            return path
    raise input_error(shown_path(text), f"no such file, in {shown_path(relative_to)} or in the working folder")


def read_scene(path: Path) -> Scene:
    """The scene in a file. Its name is the file's, without the ending.

    Raises `InputError`, one line.
    """
    where = shown_path(path)
    file = validate(SceneFile, read_toml(path), where)
    chain, start = file.chain, file.start
    key, n = chain.counts()[0]
    for other, values in (("angles", start.angles), ("rates", start.rates)):
        if isinstance(values, list) and len(values) != n:
            raise input_error(f"{where} [start]", disagreement(other, len(values), key, n))
    try:
        file.effects.terms(n)
    except InputError as error:
        raise input_error(f"{where} [effects]", str(error)) from None
    name = printable(path.stem)
    return Scene(
        name=name,
        title=file.title or name,
        duration=file.duration,
        masses=_each(chain.masses or chain.mass, n),
        lengths=_each(chain.lengths or chain.length, n),
        angles=_each(start.angles, n),
        rates=_each(start.rates, n),
        effects=file.effects,
    )


def _each(values: list[float] | float | None, n: int) -> FloatArray:
    """One number for each of n links (n,)."""
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (n,))
