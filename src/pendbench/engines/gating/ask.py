"""What a gate asks of an engine in a process of its own: what it is, and one check after the other."""

from __future__ import annotations

import importlib
import os
import sys
from dataclasses import dataclass
from functools import cache

from pendbench.base.errors import InputError, MissingEngineError, describe, printable
from pendbench.base.heard import heard
from pendbench.base.strict import show
from pendbench.engines.conformance import CHECKS
from pendbench.engines.conformance.check import Finding, Subject, findings
from pendbench.engines.conformance.surroundings import surroundings_kept
from pendbench.engines.protocol import Engine
from pendbench.engines.registry import engine as engine_of
from pendbench.engines.registry import flaw_of

#: An engine by its name, by `module:Class`, or itself.
Source = str | Engine


@dataclass(frozen=True)
class Description:
    """An engine. precision: single where a method declares it. flaw: why it cannot be asked, "" where it can."""

    name: str
    version: str = "unknown"
    methods: tuple[str, ...] = ()
    precision: str = "double"
    flaw: str = ""


def described(source: Source) -> Description:
    """What the engine is. Raises InputError for a name that is none, and nothing for what the engine does."""
    name = source if isinstance(source, str) else str(getattr(source, "name", type(source).__name__))
    with surroundings_kept() as flaws:
        found = _described(source, name)
    if found.flaw or not flaws:
        return found
    return Description(found.name, found.version, found.methods, found.precision, f"loading it, {flaws[0]}")


def _described(source: Source, name: str) -> Description:
    try:
        its = engine_from(source)
        if flaw := flaw_of(its):
            return Description(name, flaw=f"not an engine: {flaw}")
        single = any(method.single for method in its.methods.values())
        return Description(
            printable(its.name), str(its.version()), tuple(its.methods), "single" if single else "double"
        )
    except MissingEngineError as error:
        return Description(name, flaw=str(error))
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        return Description(name, flaw=f"it cannot be loaded ({describe(error)})")


def engine_from(source: Source) -> Engine:
    """The engine. Raises whatever loading it does."""
    return _loaded(source) if isinstance(source, str) else source


@cache
def _loaded(source: str) -> Engine:
    module, colon, name = source.partition(":")
    if not colon:
        return engine_of(source)
    if not all(part.isidentifier() for part in (*module.split("."), name)):
        raise InputError(f"engine is {show(source)}; allowed: a name, or module:Class")
    if (here := os.getcwd()) not in sys.path:
        sys.path.insert(0, here)
    its: Engine = getattr(importlib.import_module(module), name)()
    return its


def asked(source: Source, method: str, name: str, seed: int) -> list[Finding]:
    """What one check finds with one method. What the engine prints meanwhile is heard by nobody."""
    one = next(each for each in CHECKS if each.name == name)
    before = os.getcwd()
    try:
        with heard():
            return findings(one, Subject(engine_from(source), method, seed))
    finally:
        os.chdir(before)
