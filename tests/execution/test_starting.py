"""Workers are copies of one process, and nobody can tell them from processes that start from nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from pendbench.execution import starting
from pendbench.execution.pool import Job, LocalPool
from pendbench.execution.starting import FromNothing, way_to_start
from support import job_functions as does

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")


def told(function, *arguments):
    """What a worker of a pool of its own finds."""
    with LocalPool(1) as pool:
        (outcome,) = pool.run([Job("a", function, arguments, 60.0)])
    assert outcome.fault is None, outcome.fault
    return outcome.value


def test_who_is_copied_has_loaded_numba():
    assert told(does.what_the_parent_has_loaded, "llvmlite")
    assert not told(does.what_the_parent_has_loaded, "mujoco")  # an engine is for those who run it


def test_a_worker_has_the_variables_and_the_folder_of_who_asks(monkeypatch, tmp_path):
    monkeypatch.setenv("PENDBENCH_TEST", "before")
    assert told(does.variable_and_folder, "PENDBENCH_TEST") == ("before", os.getcwd())
    monkeypatch.setenv("PENDBENCH_TEST", "after")
    monkeypatch.chdir(tmp_path)
    assert told(does.variable_and_folder, "PENDBENCH_TEST") == ("after", str(tmp_path))
    monkeypatch.delenv("PENDBENCH_TEST")
    assert told(does.variable_and_folder, "PENDBENCH_TEST") == (None, str(tmp_path))


def test_what_is_read_as_it_is_loaded_is_read_again_where_it_changed(monkeypatch, tmp_path):
    told(does.process)  # somebody is there now whom others may be copies of
    assert told(does.parent_of_this) != os.getpid()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert told(does.parent_of_this) == os.getpid()
    assert told(does.cache_of_numba) == str(tmp_path)
    monkeypatch.undo()
    assert told(does.parent_of_this) != os.getpid()


def test_where_to_import_from_is_no_reason_to_start_from_nothing(monkeypatch, tmp_path):
    told(does.process)
    (tmp_path / "of_ones_own.py").write_text("def answer():\n    return 42\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.syspath_prepend(tmp_path)
    import of_ones_own

    assert told(of_ones_own.answer) == 42
    assert told(does.parent_of_this) != os.getpid()


def test_who_is_copied_is_started_again_after_its_end():
    parent = told(does.parent_of_this)
    os.kill(parent, signal.SIGKILL)
    os.waitid(os.P_PID, parent, os.WEXITED | os.WNOWAIT)
    assert told(does.parent_of_this) not in (parent, os.getpid())


def test_a_file_beside_the_user_is_not_taken_for_a_library(tmp_path):
    (tmp_path / "numba.py").write_text("raise SystemExit('not the library')\n")
    script = tmp_path / "elsewhere" / "script.py"
    script.parent.mkdir()
    script.write_text(
        "from pendbench.execution.pool import Job, LocalPool\n"
        "import os\n"
        "if __name__ == '__main__':\n"
        "    with LocalPool(1) as pool:\n"
        "        print([outcome.fault for outcome in pool.run([Job('a', os.getcwd, (), 60.0)])])\n"
    )
    ran = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "[None]\n", "")


def test_elsewhere_than_on_linux_they_start_from_nothing(monkeypatch):
    monkeypatch.setattr(starting.sys, "platform", "darwin")
    assert type(way_to_start()) is FromNothing
