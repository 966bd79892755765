"""The engines that this environment can load: the optional ones are tested where they are installed."""

from __future__ import annotations

from pendbench.base.errors import MissingEngineError
from pendbench.engines.registry import engine, engine_names

ALWAYS = ("analytic", "mujoco", "pymunk", "scipy", "xpbd")


def installed_engines() -> list[str]:
    """The names of the engines that can be loaded; a core one that cannot is an error."""
    names = []
    for name in engine_names():
        try:
            engine(name)
        except MissingEngineError:
            if name in ALWAYS:
                raise
        else:
            names.append(name)
    return names
