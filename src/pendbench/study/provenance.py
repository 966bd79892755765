"""What a result comes from: programs, machine, settings, content."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from typing import Any

from pendbench import __version__
from pendbench.base.processes import THREAD_VARIABLES, processor
from pendbench.base.source import source_digest
from pendbench.study.ask import version
from pendbench.study.plan import Plan

_LIBRARIES = ("numpy", "scipy", "numba", "pandas")


def provenance(plan: Plan, workers: int) -> dict[str, Any]:
    """What the results of a plan come from, by name."""
    names = sorted({case.engine for case in plan.cases})
    return {
        "pendbench": __version__,
        "pendbench source": source_digest(),
        **{f"engine {name}": version(name) for name in names},
        **{f"engine {name}": f"left out: {why}" for name, why in plan.absent.items()},
        **{name: metadata.version(name) for name in _LIBRARIES},
        "python": platform.python_version(),
        "operating system": platform.platform(),
        "processor": processor(),
        "logical processors": os.cpu_count(),
        "worker processes": workers,
        "threads per engine": 1,
        **{name: os.environ.get(name, "1") for name in THREAD_VARIABLES},  # of worker processes on this machine
        "NUMBA_NUM_THREADS": os.environ.get("NUMBA_NUM_THREADS", "not set"),
        "seed": getattr(plan.options, "seed", None),
        "study": plan.name,
        "kind": plan.options.kind,
        "study content": plan.digest,
        "quick": plan.quick,
        **{f"scene {scene.name}": scene.digest for scene in plan.scenes},
    }
