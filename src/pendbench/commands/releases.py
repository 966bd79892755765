"""Runs the same studies with several releases of an engine, each in an environment of its own, in turn."""

from __future__ import annotations

import hashlib
import json
import re
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pendbench.base.errors import InputError
from pendbench.base.files import write_whole
from pendbench.base.source import source_digest, surroundings
from pendbench.commands.sides import Results, read_side
from pendbench.engines.registry import packages
from pendbench.execution.environments import (
    Environment,
    InstallError,
    check_installer,
    clean,
    environment,
    reason_of,
)
from pendbench.execution.runner import Watcher
from pendbench.scene.scene import Scene, load_scene

if TYPE_CHECKING:
    import pandas as pd

#: What a step is for errors and costs, and the first that is tried in the search for the largest stable one, s.
STEP_S: Final = 1e-3
_TRIED_S: Final = 1e-2
_FINEST_S: Final = 1e-4
#: Errors are compared, and runs have to hold, up to here, s: no chaos makes numbers of rounding so early.
WINDOW_S: Final = 1.0
_SAMPLES: Final = 50
#: A study of a release that takes longer than this by the clock, s, is given up.
_HANGS_S: Final = 3600.0
_STOPPING_S: Final = 15.0


@dataclass(frozen=True)
class Asked:
    """What was asked for. versions: the earliest first. scenes: names or files. rounds: of the clock."""

    engine: str
    versions: tuple[str, ...]
    scenes: tuple[str, ...]
    rounds: int
    out: Path


@dataclass(frozen=True)
class Release:
    """What was found of a release. reason: why something is missing, empty where nothing is.

    package: in which it came. costs: tables of cases with errors and costs, one for each round of the clock.
    stability: the table of cases with the largest stable steps.
    """

    version: str
    reason: str = ""
    package: str = ""
    costs: tuple[pd.DataFrame, ...] = ()
    stability: pd.DataFrame | None = None


@dataclass(frozen=True)
class _Job:
    """A study of a release: its file, and the folder of its results."""

    version: str
    study: str
    folder: Path


def run_releases(asked: Asked, watcher: Watcher) -> tuple[Release, ...]:
    """What each release does. Rounds of the clock go forth and back over the releases, so that no drift of the machine
    looks like one of the engine.

    Raises InputError where scenes or the engine cannot be used, or there is nothing to install releases with.
    """
    names = packages(asked.engine)
    studies = _studies(asked.engine, [_found(name) for name in asked.scenes])
    check_installer()
    for name, text in studies.items():
        write_whole(asked.out / f"{name}.toml", lambda file, text=text: file.write(text.encode()))  # type: ignore[misc]
    releases, places = _installed(asked, names, watcher)
    for stage, jobs in _stages(asked):
        watcher.begin(stage, len(jobs), 0)
        for job in jobs:
            release = releases[job.version]
            if not release.reason:
                releases[job.version] = _with(release, job, places[job.version], studies[job.study], asked.out)
            watcher.advance()
    return tuple(releases.values())


def _found(name: str) -> tuple[str, Scene]:
    """A scene as a study names it, and the scene itself. Raises InputError where it is too short."""
    scene = load_scene(name)
    if scene.duration < 20 * _TRIED_S:
        raise InputError(f"--scenes: {name} is {scene.duration:g} s long; allowed: from {20 * _TRIED_S:g} s on")
    return (str(Path(name).absolute()) if Path(name).suffix else name), scene


def _studies(engine: str, scenes: Sequence[tuple[str, Scene]]) -> dict[str, str]:
    """The studies, as their files: one of errors and costs, one of stability."""
    head = f"scenes = {json.dumps([name for name, _ in scenes])}\n"
    table = f"\n[[engines]]\nname = {json.dumps(engine)}\ndt = [%r]\n"
    spans = {json.dumps(scene.name): min(WINDOW_S, scene.duration) for _, scene in scenes}
    windows = "".join(f"\n[windows.{name}]\ntime = {span!r}\nsamples = {_SAMPLES}\n" for name, span in spans.items())
    durations = "\n[durations]\n" + "".join(f"{name} = {span!r}\n" for name, span in spans.items())
    return {
        "cost": f'kind = "cost"\n{head}{windows}{table % STEP_S}',
        "stability": f'kind = "stability"\n{head}finest = {_FINEST_S!r}\n{durations}{table % _TRIED_S}',
    }


def _installed(
    asked: Asked, names: Sequence[str], watcher: Watcher
) -> tuple[dict[str, Release], dict[str, Environment]]:
    """The releases, those that cannot be installed with the reason, and the environments of the others."""
    fixed = dict(_shared(names))
    releases, places = {}, {}
    watcher.begin("environments", len(asked.versions), 0)
    for version in asked.versions:
        try:
            places[version] = environment(names, version, fixed)
            releases[version] = Release(version, package=places[version].package)
        except InstallError as error:
            releases[version] = Release(version, f"does not install: {error}")
        watcher.advance()
    return releases, places


def _shared(but: Sequence[str]) -> Iterator[tuple[str, str]]:
    """What pendbench stands on, as it is installed here, but for these packages."""
    for wanted in metadata.requires("pendbench") or ():
        name = re.split(r"[^\w.-]", wanted, maxsplit=1)[0]
        if "extra ==" not in wanted and name not in but:
            with suppress(metadata.PackageNotFoundError):
                yield name, metadata.version(name)


def _stages(asked: Asked) -> Iterator[tuple[str, list[_Job]]]:
    """The first round tells which releases run at all."""
    for number in range(1, asked.rounds + 1):
        order = asked.versions if number % 2 else asked.versions[::-1]
        jobs = [_Job(version, "cost", asked.out / version / "cost" / str(number)) for version in order]
        yield f"errors and costs, round {number}", jobs
        if number == 1:
            yield "stable steps", [_Job(each, "stability", asked.out / each / "stability") for each in asked.versions]


def _with(release: Release, job: _Job, place: Environment, text: str, out: Path) -> Release:
    """The release with what this study finds of it; or with the reason why it finds nothing."""
    failed = _run(job, place, text, out)
    if failed:
        return replace(release, reason=f"does not run: {failed}")
    side = read_side(job.folder)
    assert isinstance(side, Results)
    ends = side.tables[0]
    if job.study == "cost" and (ends["status"] == "error").all():  # it lacks what the adapter asks for
        return replace(release, reason=f"does not run: {'; '.join(dict.fromkeys(ends['reason']))}"[:300])
    if job.study == "stability":
        return replace(release, stability=side.tables[0])
    return replace(release, costs=(*release.costs, side.tables[0]))


def _run(job: _Job, place: Environment, text: str, out: Path) -> str:
    """Run a study, unless it has been; why it failed, empty where it did not."""
    key = hashlib.sha256(json.dumps([text, source_digest(), *surroundings(), place.package]).encode()).hexdigest()
    mark = job.folder / "finished"
    if mark.exists() and mark.read_text("utf-8", "replace") == key:
        return ""
    mark.unlink(missing_ok=True)
    command = [str(place.python), "-P", "-m", "pendbench", "study", str(out / f"{job.study}.toml"),
               "--out", str(job.folder), "--bare", "--jobs", "1"]  # fmt: skip
    code, said = _called(command)
    if code:
        crash = f"ended by signal {signal.Signals(-code).name}" if code < 0 else ""
        return crash or reason_of(said).removeprefix(f"{out / job.study}.toml ").partition("; install it with")[0]
    write_whole(mark, lambda file: file.write(key.encode()))
    return ""


def _called(command: Sequence[str]) -> tuple[int, str]:
    """The exit code of a command, and what it says on standard error. It ends before this process does."""
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        errors="replace", env=clean(),
    ) as process:  # fmt: skip
        try:
            _, said = process.communicate(timeout=_HANGS_S)
        except subprocess.TimeoutExpired:
            _end(process)
            return 1, f"took longer than {_HANGS_S:g} s"
        except BaseException:
            _end(process)
            raise
        return process.returncode, said


def _end(process: subprocess.Popen[str]) -> None:
    """Ask a study to end, which keeps what it has finished; one that does not is ended."""
    process.terminate()
    try:
        process.communicate(timeout=_STOPPING_S)
    except subprocess.TimeoutExpired:
        process.kill()
