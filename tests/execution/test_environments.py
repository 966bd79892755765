"""Environments for releases: made from wheels that the test writes, without a network."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from pendbench.execution import environments
from pendbench.execution.environments import InstallError, clean, environment, reason_of

needs_pip = pytest.mark.skipif(not (find_spec("venv") and find_spec("pip")), reason="no venv with pip")


def wheel(folder, name, version, source):
    """A wheel of one module."""
    about = f"{name}-{version}.dist-info"
    with zipfile.ZipFile(folder / f"{name}-{version}-py3-none-any.whl", "w") as file:
        file.writestr(f"{name}.py", source)
        file.writestr(f"{about}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        file.writestr(
            f"{about}/WHEEL", "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        file.writestr(f"{about}/RECORD", "")


@needs_pip
def test_an_environment_has_its_release_and_shares_the_rest(tmp_path, monkeypatch):
    wheel(tmp_path, "madeup_engine", "1.0", "who = 'one'")
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "madeup_engine.py").write_text("who = 'here'")
    monkeypatch.syspath_prepend(str(tmp_path / "here"))
    for name, value in {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}.items():
        monkeypatch.setenv(name, value)
    for name in ("PIP_EXTRA_INDEX_URL", "PIP_INDEX_URL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(environments.shutil, "which", lambda _: None)
    found = environment(["madeup_new_name", "madeup_engine"], "1.0", {"numpy": "2.0.0"})
    assert found.package == "madeup_engine"
    code = "import madeup_engine, pendbench, numpy; print(madeup_engine.who, pendbench.__file__, numpy.__file__)"
    done = subprocess.run([found.python, "-P", "-c", code], capture_output=True, text=True, env=clean(), check=True)
    import numpy

    import pendbench

    assert done.stdout.split() == ["one", pendbench.__file__, numpy.__file__]
    made = os.stat(found.python.parent).st_mtime_ns
    assert environment(["madeup_new_name", "madeup_engine"], "1.0", {"numpy": "2.0.0"}) == found
    assert os.stat(found.python.parent).st_mtime_ns == made
    kept = sorted(folder.name for folder in environments.folder_of_environments().iterdir())
    assert len(kept) == 1  # what did not install has left nothing


@pytest.mark.parametrize("uv", [None, "/bin/uv"])
def test_what_does_not_install_leaves_nothing_and_says_why(tmp_path, monkeypatch, uv):
    """The installer is a program that fails, and the environment is half made by then."""
    commands = []

    def run(command, **_):
        commands.append(command)
        if "install" not in command:
            Path(command[-1]).mkdir()
            return subprocess.CompletedProcess(command, 0, "", "")
        return subprocess.CompletedProcess(
            command, 1, "", "WARNING: x\nERROR: No matching distribution found for a==9\n"
        )

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(environments.shutil, "which", lambda _: uv)
    monkeypatch.setattr(environments.subprocess, "run", run)
    with pytest.raises(InstallError, match=r"^No matching distribution found for a==9$"):
        environment(["a"], "9", {"numpy": "2.0.0"})
    assert not list(environments.folder_of_environments().iterdir())
    assert commands[0][:3] == ([uv, "venv", "--python"] if uv else [sys.executable, "-m", "venv"])
    assert "a==9" in commands[1]
    assert "--only-binary" in commands[1]


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ("", "it says nothing"),
        ("one\n  two\n", "two"),
        ("error: bad\nmore\n", "bad"),
        ("ERROR: first\nERROR: last\nWARNING: x", "last"),
        (
            "ERROR: Could not find a version of a==1 (from versions: none)\nERROR: No match for a==1",
            "No match for a==1: no version of it is to be found, or nothing is without a network",
        ),
    ],
)
def test_the_reason_is_the_installers_own(said, reason):
    assert reason_of(said) == reason


def test_nothing_to_install_with_is_one_line(monkeypatch):
    monkeypatch.setattr(environments.shutil, "which", lambda _: None)
    monkeypatch.setattr(environments, "find_spec", lambda _: None)
    with pytest.raises(environments.InputError, match="neither uv nor venv with pip is there"):
        environments.check_installer()
