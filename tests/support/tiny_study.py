"""A study of seconds, and ways to run one without its workers or its report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from pendbench.base.bundled import bundled
from pendbench.commands import run as api
from pendbench.execution.pool import Job, Outcome

HEAD = """
title         = "A tiny study"
scenes        = ["double.toml", "double_calm.toml"]
starts        = 1
seed          = 3
sample        = 0.05
lyapunov_time = 10.0
"""

ENGINES = """
[[engines]]
name    = "analytic"
methods = ["adaptive"]

[[engines]]
name    = "analytic"
methods = ["rk4"]
dt      = [1e-2, 1e-3]

[[engines]]
name    = "mujoco"
methods = ["euler"]
dt      = [1e-2, 1e-3]

[[engines]]
name    = "pymunk"
methods = ["tuned"]
dt      = [1e-2, 1e-3]
"""

#: A smaller one, of four cases.
SMALL_HEAD = 'title = "A small study"\nscenes = ["double.toml"]\nstarts = 1\nsample = 0.05\nlyapunov_time = 5.0\n'
SMALL_ENGINES = """
[[engines]]
name    = "analytic"
methods = ["adaptive", "rk4"]
dt      = [1e-2]

[[engines]]
name    = "mujoco"
methods = ["euler"]
dt      = [1e-2, 5e-3]
"""

#: Columns that the rows of every kind have.
FIXED = ["scene", "n", "engine", "method", "dt", "status", "reason"]
FIXED += ["horizon_s", "error_max", "energy_drift_max", "step_us", "run_s"]


def write_study(folder: Path, engines: str = ENGINES, head: str = HEAD, name: str = "tiny") -> Path:
    """A study file in `folder`, with its two scenes of two seconds."""
    for scene in ("double", "double_calm"):
        text = (bundled("models") / f"{scene}.toml").read_text()
        (folder / f"{scene}.toml").write_text(text.replace("duration = 10.0", "duration = 2.0"))
    path = folder / f"{name}.toml"
    path.write_text(head + engines)
    return path


class Pool:
    """Stands for the pool of processes."""

    def __init__(self, workers: int = 1) -> None:
        self.workers = workers

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *error: object) -> None:
        pass


class Inline(Pool):
    """Runs jobs in this process, one after the other."""

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:  # noqa: ARG002
        for job in jobs:
            yield Outcome(job, job.function(*job.arguments))


class Idle(Pool):
    """Runs nothing, and fails where it is asked to."""

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:  # noqa: ARG002
        asked = [job.function.__name__ for job in jobs]
        assert not asked, f"asked to run {asked}"
        yield from ()


class Log:
    """Watches a study: how many jobs each stage had, and how many of them were on disk."""

    def __init__(self) -> None:
        self.stages: dict[str, tuple[int, int]] = {}
        self.advances = 0

    def begin(self, stage: str, total: int, done: int) -> None:
        self.stages[stage] = total, done

    def advance(self) -> None:
        self.advances += 1


def run(path: Path, out: Path, pool: type | None = None, *, report: bool = False, **options: object) -> api.Finished:
    """Run a study in this process: in the pool given, and without drawing its report unless that is asked for."""
    log = options.pop("log", None)
    with pytest.MonkeyPatch.context() as patch:
        if pool is not None:
            patch.setattr(api, "LocalPool", pool)
        if not report:
            patch.setattr(api, "write_report", lambda report, out, stage: None)  # noqa: ARG005
            patch.setattr(api, "measure_motions", lambda cases, runner: None)  # noqa: ARG005
        return api.run_request(api.Request(path, out, **options), log)
