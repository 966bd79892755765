"""Which engines there are, and how to get one. Nothing is loaded before it is asked for.

An engine from another package is found through the entry-point group `pendbench.engines`: the entry names a class
without arguments, or a function, that gives an `Engine`.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib.metadata import EntryPoint, entry_points, requires
from typing import Any, Final, NamedTuple, cast

from pendbench.base.errors import InputError, MissingEngineError, choose, describe, printable
from pendbench.base.strict import show
from pendbench.engines.protocol import Engine, Method

GROUP: Final = "pendbench.engines"
#: The variable that names engines of other environments, so that worker processes inherit it: a JSON object.
PYTHONS: Final = "PENDBENCH_PYTHONS"

Factory = Callable[[], Engine]

# Where each is loaded from, and what pip installs to make that work. pyproject.toml says the same to others; this
# table serves a source checkout, and keeps other packages from taking these names.
_BUNDLED: Final = {
    "analytic": ("pendbench.engines.analytic.adapter:AnalyticEngine", "pendbench"),
    "box2d": ("pendbench.engines.box2d:Box2dEngine", "pendbench"),
    "dart": ("pendbench.engines.dart:DartEngine", "pendbench"),
    "drake": ("pendbench.engines.drake:DrakeEngine", "pendbench"),
    "exudyn": ("pendbench.engines.exudyn.adapter:ExudynEngine", "pendbench"),
    "heyoka": ("pendbench.engines.heyoka:HeyokaEngine", "pendbench"),
    "mujoco": ("pendbench.engines.mujoco.adapter:MujocoEngine", "mujoco-core"),
    "mjx": ("pendbench.engines.mjx:MjxEngine", "pendbench"),
    "newton": ("pendbench.engines.newton:NewtonEngine", "pendbench"),
    "pinocchio": ("pendbench.engines.pinocchio:PinocchioEngine", "pendbench"),
    "pybullet": ("pendbench.engines.pybullet:PybulletEngine", "pendbench"),
    "pymunk": ("pendbench.engines.pymunk.adapter:PymunkEngine", "pymunk"),
    "rapier": ("pendbench.engines.rapier.adapter:RapierEngine", "pendbench"),
    "scipy": ("pendbench.engines.scipy:ScipyEngine", "scipy"),
    "xpbd": ("pendbench.engines.xpbd.adapter:XpbdEngine", "pendbench"),
}
# What their programs were called in earlier releases.
_FORMERLY: Final = {"mujoco": ("mujoco",)}
# Those that pendbench brings along; the program of each of the others comes with an extra of the same name.
_ALONG: Final = frozenset({"analytic", "mujoco", "pymunk", "scipy", "xpbd"})
# Those that run where no engines are named; the others are many, and most step in Python or compile for long.
_UNASKED: Final = frozenset({"analytic", "heyoka", "mujoco", "pinocchio", "pymunk"})
_registered: dict[str, Factory] = {}


def register(name: str, factory: Factory) -> None:
    """Make an engine known under `name` in this process, in place of any other of that name.

    Worker processes do not see it: an engine that a study is to run in parallel needs an entry point. Raises
    `InputError` for the name of a bundled engine, which a worker would run instead.
    """
    if name in _BUNDLED:
        raise InputError(f"engine {name!r} comes with pendbench; allowed: another name for yours")
    _registered[name] = factory


def engine_names() -> tuple[str, ...]:
    """The names of all engines that can be asked for, sorted. None of them is loaded."""
    return tuple(sorted({*_registered, *_BUNDLED, *entry_points(group=GROUP).names}))


def only_by_name(name: str) -> bool:
    """Whether an engine runs only where it is named, and not where all are that are installed. Loads nothing."""
    return name in _BUNDLED and name not in _UNASKED


def comes_along(name: str) -> bool:
    """Whether an engine is installed with pendbench itself, or was registered in this process."""
    return name in _registered or name in _ALONG


def python_of(name: str) -> str | None:
    """The Python of another environment that has an engine, where one was named; None for an engine of this one."""
    return cast("str | None", json.loads(os.environ.get(PYTHONS, "{}")).get(name))


def is_foreign(name: str) -> bool:
    """Whether the engine is somebody else's, found through an entry point: nobody here has ever loaded it."""
    return name not in _registered and name not in _BUNDLED and name in entry_points(group=GROUP).names


def packages(name: str) -> tuple[str, ...]:
    """The packages in which an engine's program has come over time, today's first. Loads nothing.

    Raises InputError for an unknown engine, and for one whose program is pendbench itself.
    """
    source = _source(name)
    package = source.package
    if name in _BUNDLED and name not in _ALONG:
        found = (re.match(r"([\w.-]+).*;.*extra == .(\w+).$", each) for each in requires("pendbench") or ())
        package = next((its[1] for its in found if its and its[2] == name), None)
    if package is None or package == "pendbench":
        raise InputError(f"engine {name!r} comes with pendbench; allowed: an engine that has releases of its own")
    return package, *_FORMERLY.get(name, ())


def try_to_load(name: str) -> None:
    """Load an engine and ask its version, whatever that raises: to see whether the process survives it."""
    with suppress(Exception, SystemExit):
        engine(name).version()


def engine(name: str) -> Engine:
    """The engine of that name, loaded now.

    Raises `InputError` for an unknown name, and `MissingEngineError` for an engine that cannot be loaded, with the
    command that installs it; one line each. A broken engine does not affect the others.
    """
    if (path := python_of(name)) is not None:
        from pendbench.engines.elsewhere import stand_in

        return stand_in(name, path)
    source = _source(name)
    try:
        made = source.load()()
    except ImportError as error:
        raise source.missing(f"cannot be loaded ({describe(error)})") from error
    except Exception as error:
        raise source.missing(f"is broken ({describe(error)})") from error
    if flaw := flaw_of(made):
        raise source.missing(f"is not an engine ({flaw})")
    if made.name != name:
        raise source.missing(f"calls itself {show(made.name)}")
    return made


class _Source(NamedTuple):
    """Where an engine comes from: a function that finds its factory, and the package that holds it, if any."""

    name: str
    load: Callable[[], Factory]
    package: str | None

    def missing(self, why: str) -> MissingEngineError:
        command = f"; install it with: pip install --upgrade {self.package}" if self.package else ""
        return MissingEngineError(f"engine {self.name!r} {why}{command}")


def _source(name: str) -> _Source:
    if name in _registered:
        return _Source(name, lambda: _registered[name], None)
    if name in _BUNDLED:
        target, package = _BUNDLED[name]
        wanted = f'"{package}[{name}]"' if name not in _ALONG else package
        return _Source(name, EntryPoint(name, target, GROUP).load, wanted)
    offers = {_package(entry): entry for entry in entry_points(group=GROUP, name=name)}
    if not offers:
        raise InputError(choose("engine", printable(str(name)), engine_names()))
    if len(offers) > 1:
        raise MissingEngineError(f"engine {name!r} is offered by {' and by '.join(sorted(offers))}; uninstall one")
    package, entry = offers.popitem()
    return _Source(name, entry.load, package)


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else entry.module


def flaw_of(made: Any) -> str | None:
    """What an object lacks to be an engine, or None. The conformance kit looks deeper."""
    if not isinstance(getattr(made, "name", None), str):
        return "it has no name"
    for call in ("version", "refuses", "build"):
        if not callable(getattr(made, call, None)):
            return f"it has no {call}()"
    methods = getattr(made, "methods", None)
    if not (isinstance(methods, Mapping) and methods and all(isinstance(m, Method) for m in methods.values())):
        return "its methods are not a mapping of names to Method"
    return None
