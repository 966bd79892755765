"""A study that is killed, interrupted, out of disk or disturbed by another one loses nothing and changes nothing."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

from pendbench.base.faults import Fault
from pendbench.base.files import alone_in
from pendbench.execution.pool import Job, Outcome
from pendbench.report.tables import data_frame
from pendbench.study.truths import measure_truth
from support.clock import clocked
from support.killed import killed_in_writing
from support.tiny_study import SMALL_ENGINES, SMALL_HEAD, Idle, Inline, run, write_study

CASES = 4
#: The study is killed as it writes the file of this job, counted from the beginning; the last of them are timings.
MOMENTS = (5, 20)


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    return write_study(tmp_path_factory.mktemp("study"), SMALL_ENGINES, SMALL_HEAD, "small")


def started(study: Path, out: Path, *options: str, before: Callable[[], None] | None = None) -> subprocess.Popen:
    line = [sys.executable, "-m", "pendbench.study", str(study), "--out", str(out), *(options or ("--jobs", "1"))]
    return subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=before)  # noqa: PLW1509


def ended(process: subprocess.Popen, code: int = 0) -> str:
    """What it said on standard error, where it ended as it should."""
    _, said = process.communicate()
    assert process.returncode == code, said
    assert "Traceback" not in said
    return said


def table(out: Path) -> list[list[str]]:
    """cases.csv to the byte, but for the columns of times."""
    with open(out / "cases.csv", encoding="utf-8", newline="") as file:
        headings, *rows = csv.reader(file)
    assert len(rows) == CASES
    kept = [i for i, name in enumerate(headings) if name not in clocked()]
    assert 10 < len(kept) < len(headings)
    return [[row[i] for i in kept] for row in (headings, *rows)]


def records(out: Path) -> int:
    return len(list((out / "work").glob("*.json")))


@pytest.fixture(scope="module")
def undisturbed(study, tmp_path_factory) -> list[list[str]]:
    """The table of the study when nothing happens to it, found by two workers."""
    out = tmp_path_factory.mktemp("undisturbed")
    ended(started(study, out, "--bare", "--jobs", "2"))
    assert records(out) > MOMENTS[-1]
    return table(out)


def test_one_worker_writes_what_two_write(study, undisturbed, tmp_path):
    ended(started(study, tmp_path, "--bare", "--jobs", "1"))
    assert table(tmp_path) == undisturbed


def test_a_study_that_is_killed_again_and_again_gives_the_same_table(study, undisturbed, tmp_path):
    done = 0
    for moment in MOMENTS:
        killed_in_writing("work/*.json", moment - done, study, "--out", tmp_path, "--bare", "--jobs", "2")
        done = records(tmp_path)
        assert done == moment - 1
    assert not (tmp_path / "cases.csv").exists()
    assert "kept from before" in ended(started(study, tmp_path, "--bare", "--jobs", "2"))
    assert table(tmp_path) == undisturbed


def test_a_study_that_is_killed_as_it_reports_has_whole_files(study, undisturbed, tmp_path):
    killed_in_writing("report.md", 1, study, "--out", tmp_path, "--jobs", "1")
    assert not (tmp_path / "report.md").exists()
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
    ended(started(study, tmp_path, "--bare", "--jobs", "1"))
    assert table(tmp_path) == undisturbed


class WithoutTruths(Inline):
    """Fails to keep any truth, and does the rest."""

    def run(self, jobs: Iterable[Job], *, alone: bool = False) -> Iterator[Outcome]:
        for job in jobs:
            if job.arguments[0] is measure_truth:
                yield Outcome(job, fault=Fault("error", "OSError: [Errno 28] No space left on device"))
            else:
                yield from super().run([job], alone=alone)


def test_what_was_found_without_a_truth_is_not_taken_for_what_is_found_with_it(study, undisturbed, tmp_path):
    rows = data_frame(run(study, tmp_path, WithoutTruths, report=True).report.cases)
    assert rows.error_max.isna().all()
    assert rows.reason.str.contains("No space left on device").all()
    run(study, tmp_path, Inline, report=True)
    assert table(tmp_path) == undisturbed
    run(study, tmp_path, Idle)  # and that is kept


def test_studies_into_one_folder_wait_for_each_other(study, undisturbed, tmp_path):
    with alone_in(tmp_path, pytest.fail):
        both = [started(study, tmp_path, "--jobs", jobs, "--bare", "--fresh") for jobs in "12"]
        for each in both:
            assert each.stderr.readline().startswith("waiting for another study in this folder")
    for each in both:
        assert "kept from before" not in ended(each)
    assert table(tmp_path) == undisturbed
