"""A study that is killed, interrupted, out of disk or disturbed by another one loses nothing and changes nothing."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

from pendbench.engines.protocol import Fault
from pendbench.report.columns import column
from pendbench.study.jobs import Job, Outcome
from tiny_study import Idle, Inline, run, write_study

HEAD = """
title         = "A small study"
scenes        = ["double.toml"]
starts        = 1
sample        = 0.05
lyapunov_time = 5.0
"""

ENGINES = """
[[engines]]
name    = "analytic"
methods = ["adaptive", "rk4"]
dt      = [1e-2]

[[engines]]
name    = "mujoco"
methods = ["euler"]
dt      = [1e-2, 5e-3]
"""

CASES = 4
#: Finished jobs on disk when the study is killed; the last of them are timings.
MOMENTS = (1, 9, 20)


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return write_study(tmp_path_factory.mktemp("study"), ENGINES, HEAD, "small")


def started(study: Path, out: Path, *options: str, before: Callable[[], None] | None = None) -> subprocess.Popen:
    line = [sys.executable, "-m", "pendbench.study", str(study), "--out", str(out), *(options or ("--jobs", "2"))]
    return subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=before)  # noqa: PLW1509


def ended(process: subprocess.Popen, code: int = 0) -> str:
    """What it said on standard error, where it ended as it should."""
    _, said = process.communicate(timeout=300)
    assert process.returncode == code, said
    assert "Traceback" not in said
    return said


def table(out: Path) -> list[list[str]]:
    """cases.csv to the byte, but for the columns of times."""
    with open(out / "cases.csv", encoding="utf-8", newline="") as file:
        headings, *rows = csv.reader(file)
    assert len(rows) == CASES
    kept = [i for i, name in enumerate(headings) if not column(name).is_time]
    assert 10 < len(kept) < len(headings)
    return [[row[i] for i in kept] for row in (headings, *rows)]


def records(out: Path) -> int:
    return len(list((out / "work").glob("*.json")))


@pytest.fixture(scope="module")
def undisturbed(study, tmp_path_factory) -> list[list[str]]:
    """The table of the study when nothing happens to it, found by two workers."""
    out = tmp_path_factory.mktemp("undisturbed")
    ended(started(study, out))
    assert records(out) > MOMENTS[-1]
    return table(out)


def test_one_worker_writes_what_two_write(study, undisturbed, tmp_path):
    ended(started(study, tmp_path, "--jobs", "1"))
    assert table(tmp_path) == undisturbed


def test_a_study_that_is_killed_again_and_again_gives_the_same_table(study, undisturbed, tmp_path):
    for moment in MOMENTS:
        process = started(study, tmp_path)
        while process.poll() is None and records(tmp_path) < moment:
            time.sleep(0.005)
        process.kill()  # it alone: its workers have to see for themselves
        process.communicate(timeout=60)
        assert process.returncode == -signal.SIGKILL, "it was done before it could be killed"
        assert records(tmp_path) >= moment
    assert not (tmp_path / "cases.csv").exists()
    assert "kept from before" in ended(started(study, tmp_path))
    assert table(tmp_path) == undisturbed


def test_a_study_that_is_killed_as_it_reports_has_whole_files(study, undisturbed, tmp_path):
    process = started(study, tmp_path)
    while process.poll() is None and not (tmp_path / "cases.csv").exists():
        time.sleep(0.001)
    process.kill()
    process.communicate(timeout=60)
    assert table(tmp_path) == undisturbed
    ended(started(study, tmp_path))
    assert table(tmp_path) == undisturbed
    assert (tmp_path / "report.md").read_text(encoding="utf-8").startswith("# A small study")


@pytest.mark.skipif(os.name != "posix", reason="no limit on the size of files here")
@pytest.mark.parametrize("room", [150, 4000])
def test_a_disk_without_room_is_one_line_or_a_reason_and_nothing_bad_is_kept(study, undisturbed, tmp_path, room):
    """A limit on the size of files stands for the disk: whatever is larger cannot be written."""
    import resource

    process = started(study, tmp_path, before=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (room, room)))
    last = ended(process, 2).splitlines()[-1]
    assert last.startswith("error: [Errno 27] File too large")
    assert last.endswith("what was finished is kept")
    assert not (tmp_path / "report.md").exists()
    ended(started(study, tmp_path))
    assert table(tmp_path) == undisturbed


class WithoutTruths(Inline):
    """Fails to keep any truth, and does the rest."""

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        for job in jobs:
            if job.function.__name__ == "measure_truth":
                yield Outcome(job, fault=Fault("error", "OSError: [Errno 28] No space left on device"))
            else:
                yield from super().run([job], alone=alone)


def test_what_was_found_without_a_truth_is_not_taken_for_what_is_found_with_it(study, undisturbed, tmp_path):
    rows = run(study, tmp_path, WithoutTruths, report=True).results.cases
    assert rows.error_max.isna().all()
    assert rows.reason.str.contains("No space left on device").all()
    run(study, tmp_path, Inline, report=True)
    assert table(tmp_path) == undisturbed
    run(study, tmp_path, Idle)  # and that is kept


def test_two_studies_into_one_folder_wait_for_each_other(study, undisturbed, tmp_path):
    first = started(study, tmp_path)
    assert "compiled kernels" in first.stderr.readline()
    second = started(study, tmp_path, "--jobs", "1", "--fresh")
    assert "kept from before" not in ended(first)
    said = ended(second)
    assert said.startswith("waiting for another study in this folder")
    assert "kept from before" not in said
    assert table(tmp_path) == undisturbed
