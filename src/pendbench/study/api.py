"""Running a study from beginning to end."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import pandas as pd

from pendbench.connect import LOCAL, check_cluster
from pendbench.errors import InputError
from pendbench.files import alone_in
from pendbench.processes import processors
from pendbench.report import write_report
from pendbench.strict import show, shown_path
from pendbench.study.baseline import baseline_path, read_baseline, regressions, write_baseline
from pendbench.study.cluster import DaskPool
from pendbench.study.jobs import LocalPool
from pendbench.study.kinds import kind
from pendbench.study.plan import Plan, find_study, load_plan
from pendbench.study.provenance import provenance
from pendbench.study.results import Results
from pendbench.study.runner import Runner, Silence, Watcher
from pendbench.study.store import Store

_MOST_WORKERS: Final = 1024


@dataclass(frozen=True)
class Request:
    """What was asked for. study: a name or a file. out: a folder, `results/NAME` where None. jobs: worker processes.

    cluster: the address of a Dask cluster to run on, or `local`.
    """

    study: str | os.PathLike[str]
    out: Path | None = None
    quick: bool = False
    engines: Sequence[str] = ()
    jobs: int | None = None
    check: bool = False
    fresh: bool = False
    update_baseline: bool = False
    cluster: str | None = None


@dataclass(frozen=True)
class Finished:
    """A study that has run: its results, its folder, and what got worse where that was asked."""

    results: Results
    out: Path
    regressions: tuple[str, ...]


def _folder(request: Request, plan: Plan) -> Path:
    out = request.out if request.out is not None else Path("results") / plan.name
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
    workers = _workers(request)
    plan = load_plan(request.study, quick=request.quick, engines=request.engines)
    where = baseline_path(find_study(request.study), quick=request.quick)
    baseline = read_baseline(where) if request.check else None
    out = _folder(request, plan)
    watcher = watcher or Silence()
    with alone_in(out, lambda: watcher.begin("waiting for another study in this folder", 1, 0)):
        results = _run(plan, request, out, watcher, workers)
        write_report(results, out)
    if request.update_baseline:
        write_baseline(where, results.cases)
    worse = () if baseline is None else tuple(regressions(results.cases, baseline))
    return Finished(results, out, worse)


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


def _run(plan: Plan, request: Request, out: Path, watcher: Watcher, workers: int) -> Results:
    store = Store((out if request.cluster is None else out.absolute()) / "work")
    if request.fresh:
        store.clear()
    with LocalPool(workers) if request.cluster is None else DaskPool(request.cluster, workers, store) as pool:
        runner = Runner(store, pool, watcher, memory_limit=plan.options.memory_limit)
        results = kind(plan.options.kind).run(plan, runner)
        facts = provenance(plan, pool.workers) | (pool.facts if isinstance(pool, DaskPool) else {})
    return replace(results, provenance=facts)


def run_study(
    study: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    quick: bool = False,
    engines: str | Sequence[str] = (),
    jobs: int | None = None,
    fresh: bool = False,
    cluster: str | None = None,
) -> pd.DataFrame:
    """Run a study, write its report to `out` (default `results/NAME`), and return its table, one row per case.

    study: a bundled study's name or a file. quick: the study's quick variant. engines: only this one, or these. jobs:
    worker processes, one per processor by default. fresh: run again what an earlier run left in `out`. cluster: the
    address of a Dask cluster whose machines share the folder `out`, or `local` for one of this machine. Scripts that
    call this need the usual `if __name__ == "__main__":` guard, since it starts processes.

    Raises InputError, one line, for whatever cannot be used.
    """
    try:
        folder = None if out is None else Path(out)
    except TypeError:
        raise InputError(f"--out {show(out)}: not a path; allowed: a folder that can be written") from None
    chosen = (engines,) if isinstance(engines, str) else tuple(engines)
    request = Request(study, folder, quick=quick, engines=chosen, jobs=jobs, fresh=fresh, cluster=cluster)
    return run_request(request).results.cases
