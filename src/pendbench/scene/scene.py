"""A scene: a chain, its start, the effects it calls for, and how long."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError, choose, printable
from pendbench.base.ranges import Range
from pendbench.base.strict import input_error, show
from pendbench.effects import Effects
from pendbench.effects import names as effect_names
from pendbench.effects.term import Term
from pendbench.scene.build import VECTORS, check_names, count_of, each
from pendbench.scene.links import CENTRE, INERTIA, LINK_MASS, Links, check_links
from pendbench.scene.masses import MASS, check_masses
from pendbench.scene.not_yet import NOT_YET

__all__ = ["Effects", "Links", "Scene", "load_scene"]

LENGTH: Final = Range(1e-50, 1e50, "m")
# Beyond 1e9 rad a sine has lost half of its digits.
ANGLE: Final = Range(-1e9, 1e9, "rad")
RATE: Final = Range(-1e9, 1e9, "rad/s")
DURATION: Final = Range(1e-50, 1e9, "s")
MAX_LINKS: Final = 1_000_000
_EFFECTS: Final = 'Effects, or their names with values, as in {"gravity": 9.81}'
_LINKS: Final = "Links, or a mapping with mass, centre and inertia"


@dataclass(frozen=True, eq=False)
class Scene:
    """A chain of n point masses on rods, which are massless unless an effect says otherwise, and what happens to it.

    masses (n,) kg and lengths (n,) m from the pivot outwards; angles (n,) rad, absolute, from the downward vertical,
    counter-clockwise positive; rates (n,) rad/s; duration s. The arrays are copied, and read-only. effects: `Effects`,
    or a mapping of their names to what a scene file says of them: ``{"gravity": 9.81}``. links: where the chain is of
    rigid links, `Links`, or a mapping as in a scene file; masses is then None, and becomes n times 0. notes: what a
    model file that the scene was read from has beyond it, a line each.

    Raises `InputError`, one line, for arrays that are not (n,) with 1 to a million links, for numbers out of range
    (masses and lengths 1e-50 to 1e50, angles and rates to 1e9 either way, durations 1e-50 to 1e9), and for effects
    that do not fit n links.

    >>> import pendbench as pb
    >>> pb.Scene(
    ...     name="mine", title="A chain of mine", duration=5.0, masses=[1.0, 0.5], lengths=[0.4, 0.3],
    ...     angles=[0.5, 1.0], rates=[0.0, 0.0], effects={"gravity": 9.81},
    ... )
    <Scene 'mine': 2 links, 0.7 m, 5 s, gravity>
    """

    name: str
    title: str
    duration: float
    masses: FloatArray
    lengths: FloatArray
    angles: FloatArray
    rates: FloatArray
    effects: Effects
    links: Links | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        try:
            self._check()
        except InputError as error:
            raise input_error(f"scene {show(self.name)}", str(error)) from None

    def _check(self) -> None:
        if isinstance(self.effects, Mapping):
            object.__setattr__(self, "effects", _named(self.effects))
        for field, kind, said in (("name", str, "str"), ("title", str, "str"), ("effects", Effects, _EFFECTS)):
            if not isinstance(getattr(self, field), kind):
                raise InputError(f"{field} is {show(getattr(self, field))}; allowed: {said}")
        object.__setattr__(self, "duration", _number("duration", self.duration, DURATION))
        for field, allowed in (("lengths", LENGTH), ("angles", ANGLE), ("rates", RATE)):
            object.__setattr__(self, field, _vector(field, getattr(self, field), allowed))
        masses = _vector("masses", self.masses, MASS) if self.links is None else self._no_masses()
        object.__setattr__(self, "masses", masses)
        if not 1 <= self.n <= MAX_LINKS:
            raise InputError(f"masses has {self.n} entries; allowed: 1 to {MAX_LINKS}")
        for field in ("lengths", "angles", "rates"):
            if len(getattr(self, field)) != self.n:
                raise InputError(disagreement("masses", self.n, field, len(getattr(self, field))))
        terms = self.effects.terms(self.n)  # raises where they do not fit
        if self.links is not None:
            self._check_links(self.links)
        else:
            check_masses(self.masses, terms)

    def _no_masses(self) -> FloatArray:
        """Of rigid links: 0 at the end of each, since the links have all there is."""
        if self.masses is not None and np.any(np.asarray(self.masses) != 0.0):
            raise InputError("both masses and links are given; allowed: one of them")
        return _vector("masses", np.zeros(len(self.lengths)), Range(0.0, 0.0, "kg"))

    def _check_links(self, given: Any) -> None:
        links = _links(given, self.n)
        check_links(links, self.lengths)
        if self.effects.rod_mass is not None:
            raise InputError("both links and the effect rod_mass are given; allowed: one of them")
        object.__setattr__(self, "links", links)

    def __reduce__(self) -> tuple[type[Scene], tuple[Any, ...]]:
        """Pickled by what it was made from, so that its arrays are read-only in another process too."""
        return Scene, tuple(getattr(self, field.name) for field in dataclasses.fields(self))

    def __repr__(self) -> str:
        links = "1 link" if self.n == 1 else f"{self.n} links"
        acting = ", ".join(self.terms) or "nothing acts"
        return f"<Scene {self.name!r}: {links}, {self.total_length:.4g} m, {self.duration:g} s, {acting}>"

    @classmethod
    def chain(
        cls,
        n: int | None = None,
        *,
        length: npt.ArrayLike,
        angles: npt.ArrayLike,
        mass: npt.ArrayLike | None = None,
        links: Links | Mapping[str, Any] | None = None,
        rates: npt.ArrayLike = 0.0,
        duration: float = 10.0,
        name: str = "chain",
        title: str | None = None,
        **effects: Any,
    ) -> Scene:
        """A chain of n links, made in one line.

        length m, mass kg, angles rad, rates rad/s: one number for every link, or a list with one for each; n is needed
        where none of them is a list. links: rigid links in place of masses. Effects are given by their names, with what
        a scene file says of them, and one that is not named does not act.

        >>> import pendbench as pb
        >>> pb.Scene.chain(n=50, length=0.02, mass=0.02, angles=1.57, gravity=9.81)
        <Scene 'chain': 50 links, 1 m, 10 s, gravity>
        >>> pb.Scene.chain(length=[0.4, 0.3], mass=[2.0, 1.0], angles=[0.5, 1.0], joint_damping=0.1, gravity=9.81).n
        2

        Raises InputError, one line, as `Scene` does.
        """
        check_names(effects, ("n", "length", "angles", "mass", "links", "rates", "duration", "name", "title"))
        given = {"lengths": length, "angles": angles, "masses": mass, "rates": rates}
        if mass is None and links is None:
            raise InputError("neither mass nor links is given; allowed: one of them")
        count = count_of(given.values(), n, MAX_LINKS)
        vectors: dict[str, Any] = {key: each(value, count) for key, value in given.items()}
        for key, values in vectors.items():
            if n is not None and values is not None and len(values) != n:
                raise InputError(disagreement("n", n, key, len(values)))
        own = cast(Any, {"links": links, "effects": effects})
        return cls(name=name, title=name if title is None else title, duration=duration, **vectors, **own)

    @property
    def n(self) -> int:
        """How many links the chain has."""
        return len(self.masses)

    @cached_property
    def terms(self) -> Mapping[str, Term | Links]:
        """What acts on the chain, by the effects' names; one whose numbers are all 0 does not, and is not simulated.

        Rigid links are among them, as `links`: whoever knows point masses alone refuses them as an effect.
        """
        terms: dict[str, Term | Links] = dict(self.effects.terms(self.n))
        return MappingProxyType(terms if self.links is None else {**terms, "links": self.links})

    @property
    def total_length(self) -> float:
        """The length of the straight chain, m."""
        return float(self.lengths.sum())

    def with_start(self, angles: npt.ArrayLike, rates: npt.ArrayLike) -> Scene:
        """The same scene from another start: angles (n,) rad, rates (n,) rad/s."""
        return dataclasses.replace(self, angles=cast(FloatArray, angles), rates=cast(FloatArray, rates))

    def with_(self, **changes: Any) -> Scene:
        """The same scene with other fields or effects, each by its name; an effect that is None does not act.

        A number for masses, lengths, angles or rates is meant for every link.

        >>> import pendbench as pb
        >>> pb.load_scene("double").with_(angles=0.1, duration=2.0, joint_damping=0.05)
        <Scene 'double': 2 links, 1 m, 2 s, gravity, joint_damping>

        Raises InputError, one line, for a name that is neither, and as `Scene` does.
        """
        fields = [field.name for field in dataclasses.fields(self)]
        try:
            check_names(changes, fields)
            own = {key: value for key, value in changes.items() if key in fields}
            effects = own.pop("effects", self.effects)
            effects = _named(effects) if isinstance(effects, Mapping) else effects
            acting = {key: value for key, value in changes.items() if key not in fields}
            own["effects"] = dataclasses.replace(effects, **acting) if isinstance(effects, Effects) else effects
            if self.links is not None and own.get("links", self.links) is None and own.get("masses") is None:
                raise InputError("without links it has no masses; allowed: links=None with masses beside it, kg")
        except InputError as error:
            raise input_error(f"scene {show(self.name)}", str(error)) from None
        if own.get("links") is not None:
            own.setdefault("masses", None)
        count = count_of((own[key] for key in VECTORS if key in own), self.n, MAX_LINKS)
        return dataclasses.replace(
            self, **{key: each(its, count) if key in VECTORS else its for key, its in own.items()}
        )

    def without(self, *effects: str) -> Scene:
        """The same scene without these effects, and without those that modify them."""
        return dataclasses.replace(self, effects=self.effects.without(*effects))

    def content(self) -> str:
        """What results that depend on the scene are kept under."""
        return self.digest

    def to_toml(self) -> str:
        """The scene as the text of a scene file, which reads back as the same scene to the last bit."""
        from pendbench.scene.to_toml import to_toml

        return to_toml(self)

    @property
    def digest(self) -> str:
        """A hash of everything that decides the motion (the name and the title do not)."""
        content = hashlib.sha256()
        links = () if self.links is None else (self.links.mass, self.links.centre, self.links.inertia)
        for array in (self.masses, self.lengths, self.angles, self.rates, *links):
            content.update(array.tobytes())
        effects = {name: getattr(self.effects, name) for name in self.effects.named()}
        content.update(repr((self.n, self.duration, effects)).encode())
        return content.hexdigest()[:16]


def load_scene(path_or_name: str | os.PathLike[str], *, relative_to: Path | None = None) -> Scene:
    """The scene in a file, or the bundled scene of that name.

    A file is TOML, or a model of a planar chain in MJCF (.xml) or URDF (.urdf): docs/models.md. What ends in one of
    these or holds a path separator is a path; it is looked for in the folder `relative_to` first, where
    one is given, and then in the working folder. Anything else is the name of a bundled scene, or `ropeN`, which is a
    rope of a metre in N links.

    >>> import pendbench as pb
    >>> pb.load_scene("damped_double")
    <Scene 'damped_double': 2 links, 2 m, 5 s, gravity, joint_damping>

    Raises `InputError`, one line naming the file and the key, for whatever cannot be used.
    """
    from pendbench.scene.ropes import rope_named
    from pendbench.scene.toml_file import find_scene, read_scene  # loads pydantic, which importing a scene should not

    rope = rope_named(path_or_name)
    return read_scene(find_scene(path_or_name, relative_to)) if rope is None else rope


def scene_of(scene: Scene | str | os.PathLike[str]) -> Scene:
    """The scene itself, or the one that `load_scene` finds. Raises `InputError`."""
    return scene if isinstance(scene, Scene) else load_scene(scene)


def _named(effects: Mapping[str, Any]) -> Effects:
    for name in effects:
        if name not in effect_names():
            unknown = choose("effect", printable(str(name)[:60]), effect_names())
            raise InputError(NOT_YET.get(name) or f"effects: {unknown}")
    return Effects(**effects)


def _links(given: Any, n: int) -> Links:
    """Links with an array (n,) of their own for each of the three."""
    if isinstance(given, Mapping):
        for key in given:
            if key not in ("mass", "centre", "inertia"):
                raise InputError(f"links: {choose('key', printable(str(key)[:60]), ('mass', 'centre', 'inertia'))}")
        if missing := [key for key in ("mass", "centre", "inertia") if key not in given]:
            raise InputError(f"links has no {missing[0]}; allowed: mass, centre and inertia")
        given = Links(**given)
    if not isinstance(given, Links):
        raise InputError(f"links is {show(given)}; allowed: {_LINKS}")
    read: dict[str, FloatArray] = {}
    for key, allowed in (("mass", LINK_MASS), ("centre", CENTRE), ("inertia", INERTIA)):
        value = getattr(given, key)
        read[key] = _vector(f"links.{key}", np.full(n, value) if isinstance(value, int | float) else value, allowed)
        if len(read[key]) != n:
            raise InputError(disagreement("lengths", n, f"links.{key}", len(read[key])))
    return Links(**read)


def disagreement(key: str, count: int, other: str, other_count: int) -> str:
    """Say that two keys (`n`, or lists with one entry for each link) disagree about how many links there are."""
    return f"{_counted(key, count)} but {_counted(other, other_count)}; allowed: one entry for each link"


def _counted(key: str, count: int) -> str:
    return f"{key} is {count}" if key == "n" else f"{key} has {count} {'entry' if count == 1 else 'entries'}"


def _number(name: str, value: object, allowed: Range) -> float:
    try:
        return allowed.read(value)
    except ValueError as error:
        raise InputError(f"{name} is {show(value)}; allowed: {error}") from None


def _vector(name: str, values: npt.ArrayLike, allowed: Range) -> FloatArray:
    """The values as a read-only array (n,) of its own."""
    try:
        array = np.asarray(values)
    except (ValueError, TypeError):
        array = np.asarray(None)
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        raise InputError(f"{name} is not a list of numbers; allowed: one number for each link")
    outside = np.flatnonzero(~allowed.holds(array))
    if outside.size:
        raise InputError(f"{name}, entry {outside[0] + 1}, is {show(array[outside[0]].item())}; allowed: {allowed}")
    array = np.array(array, dtype=np.float64)
    array.setflags(write=False)
    return array
