"""Jobs that kinds of study have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from pendbench.arrays import FloatArray
from pendbench.engines.protocol import Fault
from pendbench.scene import Scene
from pendbench.study.case import Case
from pendbench.study.jobs import Job
from pendbench.study.runner import Runner
from pendbench.study.store import Store, key_of
from pendbench.study.work import compile_kernel, measure_truth


def job_of(function: Callable[..., Any], depends_on: tuple[object, ...], time_limit: float, *arguments: Any) -> Job:
    """A job whose result is kept under its function's name and what it depends on."""
    return Job(key_of(function.__name__, *depends_on), function, arguments, time_limit)


def compile_kernels(runner: Runner, cases: Sequence[Case], time_limit: float) -> None:
    """Compile what the cases and their truth need, once and side by side, before several jobs wait for the same."""
    used = {case.method for case in cases if case.engine == "analytic"}
    names = ["angle form", "adaptive", "vector form", *sorted(used - {"adaptive"})]
    jobs = [job_of(compile_kernel, (name,), time_limit, name, cases[0].scene) for name in names]
    runner.run("compiled kernels", jobs, lambda _, fault: fault_record(fault))


def truth_job(scene: Scene, times: FloatArray, store: Store, time_limit: float) -> Job:
    """The job that computes the truth of a scene at `times` (k,) s and leaves its arrays under the job's key."""
    key = key_of("truth", scene.digest, times.tobytes())
    if store.load_arrays(key) is None:
        store.forget(key)
    return Job(key, measure_truth, (scene, times, store, key), time_limit)


def fault_record(fault: Fault) -> dict[str, Any]:
    """What stands for a job that did not return."""
    return {"status": fault.status, "reason": fault.reason}
