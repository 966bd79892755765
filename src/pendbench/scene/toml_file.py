"""The keys of a scene file, and the scene that they describe."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, ClassVar, Final

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from pendbench.base.arrays import FloatArray
from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError, choose, printable
from pendbench.base.strict import input_error, read_toml, show, shown_path, validate
from pendbench.scene.links import CENTRE, INERTIA, LINK_MASS, check_links
from pendbench.scene.masses import MASS, check_masses
from pendbench.scene.not_yet import NOT_YET
from pendbench.scene.scene import ANGLE, DURATION, LENGTH, MAX_LINKS, RATE, Effects, Links, Scene, disagreement

Mass = Annotated[float, MASS]
Length = Annotated[float, LENGTH]
Angle = Annotated[float, ANGLE]
Rate = Annotated[float, RATE]
LinkMass = Annotated[float, LINK_MASS]
Centre = Annotated[float, CENTRE]
Inertia = Annotated[float, INERTIA]


def one_line_title(text: str) -> str:
    if not (text.isprintable() and 1 <= len(text) <= 200):
        raise ValueError("one line of 1 to 200 characters")
    return text


class Table(BaseModel):
    """A table whose every key is known and whose every value has its type: no text for a number, no number for text."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)


class Chain(Table):
    """[chain]: `masses` or `mass`, `lengths` or `length`, and `n`.

    A list has one entry for each link; a number is meant for every link. The two can be mixed: a list of masses with
    one length is a chain of equal rods. `n` is needed where there is no list, and must agree with any list there is.
    Where there is a table [links], it has the masses, and this one has none.
    """

    n: Annotated[int, Field(ge=1, le=MAX_LINKS)] | None = None
    """how many links"""
    mass: Mass | None = None
    """kg, of each link; 0 on rods with mass"""
    masses: Annotated[list[Mass], Field(min_length=1)] | None = None
    """kg, from the pivot outwards; 0 on a rod with mass"""
    length: Length | None = None
    """m, of each link"""
    lengths: Annotated[list[Length], Field(min_length=1)] | None = None
    """m, from the pivot outwards"""

    def counts(self) -> list[tuple[str, int]]:
        """The keys that say how many links there are, each with what it says."""
        lists = [(key, len(getattr(self, key))) for key in ("masses", "lengths") if getattr(self, key) is not None]
        return lists if self.n is None else [("n", self.n), *lists]

    def _one_of(self, one: str, each: str) -> None:
        given = [key for key in (one, each) if getattr(self, key) is not None]
        if not given:
            raise InputError(f"missing '{each}', one for each link, or '{one}', one number for all")
        if len(given) == 2:
            raise InputError(f"both {one} and {each} are given; allowed: one of them")

    def _has_no_masses(self) -> None:
        for key in ("mass", "masses"):
            if getattr(self, key) is not None:
                raise InputError(f"both {key} and the table [links] are given; allowed: one of them")

    def check(self, links: LinksTable | None) -> None:
        """Raise `InputError` where the keys do not make a chain, of these links where there are any."""
        if links is None:
            self._one_of("mass", "masses")
        else:
            self._has_no_masses()
        self._one_of("length", "lengths")
        counts = self.counts() + ([] if links is None else links.counts())
        if not counts:
            raise InputError("missing key 'n': how many links, where neither masses nor lengths is a list")
        (key, count), *others = counts
        for other, other_count in others:
            if other_count != count:
                raise InputError(disagreement(key, count, other, other_count))


class LinksTable(Table):
    """[links]: rigid links instead of point masses on massless rods. One number for every link, or a list with each."""

    mass: LinkMass | list[LinkMass]
    """kg"""
    centre: Centre | list[Centre]
    """m from the link's joint, along the link; beyond its end or behind its joint where the mass is there"""
    inertia: Inertia | list[Inertia]
    """kg m^2, about that centre; 0 is a point mass"""

    def counts(self) -> list[tuple[str, int]]:
        """As those of [chain]."""
        keys = ("mass", "centre", "inertia")
        return [(f"links.{key}", len(getattr(self, key))) for key in keys if isinstance(getattr(self, key), list)]


class Start(Table):
    """[start]: one number for every link, or a list with one for each. Without `rates` the chain starts at rest."""

    angles: Angle | list[Angle]
    """rad from the downward vertical, counter-clockwise; absolute, not relative to the link before"""
    rates: Rate | list[Rate] = 0.0
    """rad/s"""


class SceneFile(Table):
    """A scene file. Without a `title` the scene's name is its title; an effect that is not named does not act."""

    NOT_YET: ClassVar[Mapping[str, str]] = NOT_YET

    title: Annotated[str, AfterValidator(one_line_title)] | None = None
    """one line"""
    duration: Annotated[float, DURATION]
    """s"""
    links: LinksTable | None = None
    """rigid links, in place of the chain's masses"""
    chain: Chain
    """how many links, how long, and what they weigh"""
    start: Start
    """where they begin"""
    effects: Effects = Effects()
    """what acts on them"""

    @field_validator("chain")
    @classmethod
    def _is_a_chain(cls, chain: Chain, found: ValidationInfo) -> Chain:
        if "links" in found.data:  # not where its own faults are told
            chain.check(found.data["links"])
        return chain

    def count(self) -> tuple[str, int]:
        """A key that says how many links there are, with what it says."""
        links = [] if self.links is None else self.links.counts()
        return (self.chain.counts() + links)[0]


#: The endings of files that `scene/models` reads.
MODEL_FILES: Final = (".xml", ".urdf")


def find_scene(path_or_name: str | os.PathLike[str], relative_to: Path | None = None) -> Path:
    """The file of a scene that is given as `load_scene` takes it."""
    try:
        text = os.fsdecode(path_or_name)
    except TypeError:
        raise InputError(f"{show(path_or_name)} is neither the name of a scene nor a path") from None
    if not (text.lower().endswith((".toml", *MODEL_FILES)) or "/" in text or os.sep in text):
        if text not in bundled_names("models"):
            unknown = choose("scene", printable(text[:60]), bundled_names("models"))
            raise InputError(f"{unknown}, ropeN for any N, or a path that ends in .toml, .xml or .urdf")
        return bundled("models") / f"{text}.toml"
    if relative_to is None or os.path.isabs(text):
        return Path(text)
    for path in (Path(relative_to, text), Path(text)):
        if os.path.lexists(path):
            return path
    raise input_error(shown_path(text), f"no such file, in {shown_path(relative_to)} or in the working folder")


def read_scene(path: Path) -> Scene:
    """The scene in a file: TOML, MJCF (.xml) or URDF. Its name is the file's, without the ending.

    Raises `InputError`, one line.
    """
    if path.suffix.lower() in MODEL_FILES:
        from pendbench.scene.models.read import read_model  # loads MuJoCo, which reading TOML should not

        return read_model(path).scene
    return _read_toml_scene(path)


def _read_toml_scene(path: Path) -> Scene:
    where = shown_path(path)
    data = read_toml(path)
    if "engines" in data and "chain" not in data:
        command = f"pendbench study {where}"
        raise input_error(where, f"this is a study, not a scene; to run it: {command}")
    file = validate(SceneFile, data, where)
    chain, start = file.chain, file.start
    key, n = file.count()
    with _about(f"{where} [effects]"):
        file.effects.terms(n)
    masses, links = _masses(file, n, where)
    for other, values in (("angles", start.angles), ("rates", start.rates)):
        if isinstance(values, list) and len(values) != n:
            raise input_error(f"{where} [start]", disagreement(other, len(values), key, n))
    name = printable(path.stem)
    return Scene(
        name=name,
        title=file.title or name,
        duration=file.duration,
        masses=masses,
        lengths=_each(chain.lengths or chain.length, n),
        angles=_each(start.angles, n),
        rates=_each(start.rates, n),
        effects=file.effects,
        links=links,
    )


@contextmanager
def _about(table: str) -> Iterator[None]:
    """Say of an `InputError` which table of which file it is about."""
    try:
        yield
    except InputError as error:
        raise input_error(table, str(error)) from None


def _masses(file: SceneFile, n: int, where: str) -> tuple[FloatArray, Links | None]:
    """The point masses (n,) kg, and the rigid links that there are instead. Raises `InputError`."""
    chain = file.chain
    if file.links is None:
        masses = _each(chain.masses or chain.mass, n)
        with _about(f"{where} [chain]"):
            check_masses(masses, file.effects.terms(n), "masses" if chain.masses else "mass")
        return masses, None
    links = Links(*(_each(values, n) for values in (file.links.mass, file.links.centre, file.links.inertia)))
    with _about(f"{where} [links]"):
        check_links(links, _each(chain.lengths or chain.length, n))
        if file.effects.rod_mass is not None:
            raise InputError("both [links] and the effect rod_mass are given; allowed: one of them")
    return np.zeros(n), links


def _each(values: list[float] | float | None, n: int) -> FloatArray:
    """One number for each of n links (n,)."""
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (n,))
