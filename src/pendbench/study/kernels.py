"""Compiling what a study needs, once and side by side, before several jobs wait for the same."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pendbench.base.errors import InputError
from pendbench.engines.recording import simulate
from pendbench.engines.registry import engine
from pendbench.execution.limits import uncounted
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import Task, task
from pendbench.physics.acting import is_plain
from pendbench.scene.scene import Scene
from pendbench.study.case import Case
from pendbench.truth.reference import reference
from pendbench.truth.solve import solve_angles, solve_vectors

#: The kernels of the reference, each with what compiles it: under gravity alone its two forms can be had side by side.
FORMS: Final[dict[str, Callable[[Scene], object]]] = {
    "angle form": lambda scene: next(solve_angles(scene, np.array([1e-9]))),
    "vector form": lambda scene: next(solve_vectors(scene, np.array([1e-9]))),
    "reference": lambda scene: reference(scene, [1e-9]),
}


@dataclass(frozen=True)
class Compiled:
    """That a kernel is there."""

    status: str
    reason: str = ""


def compile_kernel(name: str, scene: Scene) -> Compiled:
    """Compile one of `FORMS` or a method of the analytic engine, or load it where that was done before."""
    try:
        if name in FORMS:
            FORMS[name](scene)
        else:
            adaptive = engine("analytic").methods[name].adaptive
            simulate(scene, "analytic", name, None if adaptive else 1e-9, [1e-9])
    except InputError as error:  # whoever asks for it will be told
        return Compiled("refused", str(error))
    return Compiled("ok")


def compile_engine(cases: tuple[Case, ...]) -> Compiled:
    """Begin runs of an engine that keeps what it compiles: two processes that begin one together compile the same."""
    found = Compiled("ok")
    with uncounted():
        for case in cases:
            try:
                engine(case.engine).build(case.scene, case.method, case.dt, **dict(case.settings))
            except InputError as error:  # whoever asks for it will be told
                found = Compiled("refused", str(error))
    return found


def compile_kernels(runner: Runner, scenes: Iterable[Scene], cases: Iterable[Case], *, truth: bool = True) -> None:
    """Compile the kernels of the cases, and of the scenes' truth; each for the effects that act on its scene."""
    cases = tuple(cases)
    methods: dict[tuple[str, frozenset[str]], Scene] = {}
    forms: dict[tuple[str, frozenset[str]], Scene] = {}
    for case in cases:
        if case.engine == "analytic":
            methods.setdefault((case.method, frozenset(case.scene.terms)), case.scene)
    for scene in scenes if truth else ():
        for name in ("angle form", "vector form") if is_plain(scene) else ("reference",):
            forms.setdefault((name, frozenset()), scene)  # one for all effects
    # By turns: two methods begun side by side compile the same equations, and so do two forms of the truth.
    turns = itertools.zip_longest(methods.items(), forms.items())
    wanted = dict(filter(None, itertools.chain.from_iterable(turns)))
    tasks: dict[Any, Task[Compiled]] = {own: task(compile_engine, own) for own in _of_compiling_engines(cases)}
    tasks |= {key: task(compile_kernel, key[0], scene) for key, scene in wanted.items()}
    runner.run("kernels compiled", tasks)


def _of_compiling_engines(cases: Sequence[Case]) -> Iterable[tuple[Case, ...]]:
    """A case of each method of each engine that says that it compiles; such take longest, so they come first."""
    first = {(case.engine, case.method): case for case in reversed(cases)}
    for name in sorted({case.engine for case in cases}):
        if getattr(engine(name), "compiles", False):
            yield tuple(case for case in first.values() if case.engine == name)
