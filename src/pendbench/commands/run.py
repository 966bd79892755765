"""Running a study from beginning to end."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from pendbench.base.errors import InputError
from pendbench.base.files import alone_in
from pendbench.base.processes import processors, refuse_without_guard
from pendbench.base.strict import input_error, show, shown_path
from pendbench.commands.staging import stage_of_study
from pendbench.engines.elsewhere import use
from pendbench.engines.registry import engine_names
from pendbench.execution.cluster import DaskPool
from pendbench.execution.connect import LOCAL, check_cluster
from pendbench.execution.pool import LocalPool
from pendbench.execution.runner import Runner, Silence, Watcher
from pendbench.execution.store import Store
from pendbench.report.index import write_index
from pendbench.report.page import Report
from pendbench.report.tables import data_frame
from pendbench.report.text import file_name
from pendbench.report.write import write_report, write_tables
from pendbench.scene.scene import Scene, scene_of
from pendbench.study.baseline import baseline_path, read_baseline, regressions, write_baseline
from pendbench.study.kinds import kind
from pendbench.study.motions import Motions, measure_motions
from pendbench.study.plan import Plan, find_study, load_plan
from pendbench.study.provenance import provenance
from pendbench.study.results import Results

if TYPE_CHECKING:
    from pendbench.commands.study_table import StudyTable

_MOST_WORKERS: Final = 1024
_LONGEST_NAME: Final = 100


@dataclass(frozen=True)
class Request:
    """What was asked for. study: a name or a file. out: a folder, `results/NAME` where None. jobs: worker processes.

    scenes: in place of the study's, each a `Scene` or what `load_scene` takes; then `out` is `results/NAME-SCENES`.
    bare: write the tables and where they are from, and no report.
    changes: keys over those of the study's file. cluster: the address of a Dask cluster to run on, or `local`. pythons:
    engines of other environments, each as ``ENGINE=PATH``.
    """

    study: str | os.PathLike[str]
    out: Path | None = None
    quick: bool = False
    engines: Sequence[str] = ()
    scenes: Sequence[Scene | str | os.PathLike[str]] = ()
    jobs: int | None = None
    check: bool = False
    fresh: bool = False
    update_baseline: bool = False
    cluster: str | None = None
    pythons: Sequence[str] = ()
    changes: Mapping[str, Any] = field(default_factory=dict)
    bare: bool = False


@dataclass(frozen=True)
class Finished:
    """A study that has run: its report, its folder, and what got worse where that was asked.

    compared: how many rows were compared with the baseline, None where that was not asked. notes: what model files have
    beyond the scenes that they were read as, a line each.
    """

    report: Report
    out: Path
    regressions: tuple[str, ...] = ()
    compared: int | None = None
    notes: tuple[str, ...] = ()


def _folder(request: Request, plan: Plan) -> Path:
    name = "-".join([plan.name, *(file_name(scene.name) for scene in plan.scenes if request.scenes)])
    out = request.out if request.out is not None else Path("results") / name[:_LONGEST_NAME]
    try:
        if out.is_file() or any(parent.is_file() for parent in out.parents):
            raise InputError(f"--out {shown_path(out)}: is or lies below a file; allowed: a folder that can be written")
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {shown_path(out)}: {error.strerror}; allowed: a folder that can be written") from None
    if not os.access(out, os.W_OK):
        raise InputError(f"--out {shown_path(out)}: not writable; allowed: a folder that can be written")
    return out


def run_request(request: Request, watcher: Watcher | None = None) -> Finished:
    """Run a study and write its report.

    Raises `InputError`, one line, before anything is written where the request cannot be met.
    """
    refuse_without_guard()
    workers = _workers(request)
    if request.pythons:
        if request.cluster is not None:
            raise InputError("--python is given with --cluster; allowed: one of them")
        use(request.pythons, engine_names())
    if request.scenes and (request.check or request.update_baseline):
        option = "--check" if request.check else "--update-baseline"
        raise InputError(f"{option} is about the study's own scenes; allowed: without --scenes")
    scenes = [_scene(number, each) for number, each in enumerate(request.scenes, 1)]
    plan = load_plan(
        request.study, quick=request.quick, engines=request.engines, scenes=scenes, changes=request.changes
    )
    where = baseline_path(find_study(request.study), quick=request.quick)
    baseline = read_baseline(where) if request.check else None
    out = _folder(request, plan)
    watcher = watcher or Silence()
    with alone_in(out, lambda: watcher.begin("waiting for another study in this folder", 1, 0)):
        report, motions = _run(plan, request, out, watcher, workers)
        if request.bare:
            write_tables(report, out)
        else:
            write_report(report, out, stage_of_study(motions))
    if request.out is None:
        write_index(out.parent)
    if request.update_baseline:
        write_baseline(where, data_frame(report.cases))
    notes = tuple(f"{scene.name}: {note}" for scene in plan.scenes for note in scene.notes)
    if baseline is None:
        return Finished(report, out, notes=notes)
    cases = data_frame(report.cases)
    return Finished(report, out, tuple(regressions(cases, baseline)), len(cases), notes)


def _scene(number: int, given: Scene | str | os.PathLike[str]) -> Scene:
    try:
        return scene_of(given)
    except InputError as error:
        raise input_error(f"--scenes, entry {number}", str(error)) from None


def _workers(request: Request) -> int:
    """How many processes there are to be on this machine."""
    workers = processors() if request.jobs is None else request.jobs
    if type(workers) is not int or not 1 <= workers <= _MOST_WORKERS:
        raise InputError(f"--jobs is {show(workers)}; allowed: 1 to {_MOST_WORKERS}")
    if request.cluster is not None:
        check_cluster(request.cluster)
        if request.jobs is not None and request.cluster != LOCAL:
            raise InputError(f"--jobs is {workers}; allowed: none, since a cluster has the workers that it has")
    return workers


def _run(plan: Plan, request: Request, out: Path, watcher: Watcher, workers: int) -> tuple[Report, Motions | None]:
    """The study's results, as people read them, and how some of its cases move."""
    store = Store((out if request.cluster is None else out.absolute()) / "work")
    if request.fresh:
        store.clear()
    before = store.count()
    with LocalPool(workers) if request.cluster is None else DaskPool(request.cluster, workers, store) as pool:
        runner = Runner(store, pool, watcher, plan.options.time_limit, plan.options.memory_limit)
        found = kind(plan.options.kind).measure(plan, runner)
        facts = provenance(plan, pool.workers) | (pool.facts if isinstance(pool, DaskPool) else {})
        options = plan.options
        kept = sum(stage for stage, _ in runner.kept), sum(total for _, total in runner.kept)
        unused = 0 if kept[0] else before
        title = options.title or plan.name
        report = Report(Results(plan.name, title, options.kind, found, options, facts, plan.quick, kept, unused))
        return report, None if request.bare else measure_motions(report.moving, runner)


def folder_of(out: object) -> Path | None:
    """The folder that was asked for, None where none was. Raises `InputError` for what is none."""
    if out is None:
        return None
    if out == "":
        raise InputError("--out is empty; allowed: a folder that can be written")
    try:
        return Path(cast(str, out))
    except TypeError:
        raise InputError(f"--out {show(out)}: not a path; allowed: a folder that can be written") from None


def names_of(given: object, key: str = "--engines", kind: str = "an engine") -> tuple[str, ...]:
    """The names, where one or several are given. Raises `InputError` for what is neither."""
    if isinstance(given, str):
        return (given,)
    if not isinstance(given, Iterable):
        raise InputError(f"{key} is {show(given)}; allowed: the name of {kind}, or several")
    return tuple(given)


def run_study(
    study: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    quick: bool = False,
    engines: str | Sequence[str] = (),
    scenes: Scene | str | os.PathLike[str] | Sequence[Scene | str | os.PathLike[str]] = (),
    jobs: int | None = None,
    fresh: bool = False,
    cluster: str | None = None,
) -> StudyTable:
    """Run a study, write its report to `out` (default `results/NAME`), and return what it found.

    That is a pandas DataFrame with one row per case, and with `.cases`, `.answer` and `.folder`.

    study: a bundled study's name or a file. quick: the study's quick variant. engines: only this one, or these. scenes:
    this one, or these, in place of the study's; each a `Scene` or what `load_scene` takes. jobs: worker processes, one
    per processor by default. fresh: run again what an earlier run left in `out`. cluster: the address of a Dask cluster
    whose machines share the folder `out`, or `local` for one of this machine. Scripts that call this need the usual
    `if __name__ == "__main__":` guard, since it starts processes.

    >>> import pendbench as pb
    >>> arm = pb.Scene.chain(n=2, length=0.4, mass=1.0, angles=1.0, gravity=9.81, name="arm")
    >>> found = pb.run_study("chaos", scenes=arm, quick=True)  # doctest: +SKIP
    >>> found.answer, found.folder  # doctest: +SKIP

    Raises InputError, one line, for whatever cannot be used.
    """
    from pendbench.commands.study_table import StudyTable

    folder, chosen = folder_of(out), names_of(engines)
    others = (scenes,) if isinstance(scenes, Scene | str | os.PathLike) else tuple(scenes)
    request = Request(
        study, folder, quick=quick, engines=chosen, scenes=others, jobs=jobs, fresh=fresh, cluster=cluster
    )
    finished = run_request(request)
    return StudyTable.of(finished.report, finished.out)
