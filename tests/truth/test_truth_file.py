"""The truth as files: what is read back is the reference, to the last bit, with all that tells what it is."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pendbench.__main__ import main
from pendbench.scene.scene import load_scene
from pendbench.truth.reference import reference
from pendbench.truth.truth_file import write_truth

PAGE = Path(__file__).parents[2] / "docs/truth_files.md"
TIMES = np.arange(6) * 0.1


@pytest.fixture(scope="module")
def truth():
    return reference("double", TIMES)


def read(path):
    """A CSV file of the truth: its text, and its columns by name."""
    told, names, *rows = path.read_text().splitlines()
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    return json.loads(told.removeprefix("# ")), dict(zip(names.split(","), values.T, strict=True))


def test_both_formats_hold_the_reference_to_the_last_bit(truth, tmp_path):
    scene = load_scene("double")
    write_truth(scene, truth, tmp_path / "a.npz")
    write_truth(scene, truth, tmp_path / "a.csv")
    arrays = np.load(tmp_path / "a.npz")
    told, columns = read(tmp_path / "a.csv")
    for name in ("theta", "omega", "theta_low", "omega_low"):
        assert np.array_equal(arrays[name], getattr(truth, name))
        assert np.array_equal(np.column_stack([columns[f"{name}_{link}"] for link in (1, 2)]), getattr(truth, name))
    for name in ("t", "bound"):
        assert np.array_equal(arrays[name], getattr(truth, name))
        assert np.array_equal(columns[name], getattr(truth, name))
    assert json.loads(str(arrays["about"])) == told
    assert told["horizon_s"] == truth.horizon
    assert told["error"] == truth.error


def test_the_scene_in_it_is_the_scene(truth, tmp_path):
    scene = load_scene("double")
    write_truth(scene, truth, tmp_path / "a.csv")
    told, _ = read(tmp_path / "a.csv")
    (tmp_path / "again.toml").write_text(told["scene_file"])
    assert load_scene(tmp_path / "again.toml").digest == scene.digest


def test_the_checksum_is_that_of_the_file(truth, tmp_path):
    file, checksum = write_truth(load_scene("double"), truth, tmp_path / "a.csv")
    assert checksum.read_text() == f"{hashlib.sha256(file.read_bytes()).hexdigest()}  a.csv\n"


def test_the_command_writes_what_it_says(tmp_path, capsys):
    out = tmp_path / "double.csv"
    assert main(["truth", "double", "--until", "0.5", "--every", "0.1", "--out", str(out)]) == 0
    assert "until 0.5 s" in capsys.readouterr().out
    _, columns = read(out)
    assert np.array_equal(columns["t"], TIMES)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["double", "--out", "double.txt"], "allowed: a name that ends in .npz or .csv"),
        (["double", "--out", ""], "--out is empty"),
        (["double", "--until", "-1"], "--until is -1.0; allowed: a number from 1e-09"),
        (["double", "--every", "0"], "--every is 0.0; allowed: a number from 1e-09"),
        (["double", "--every", "1e-8"], "--every is 1e-08; allowed: from 2e-06 to 10 s, for 10 s"),
        (["double", "--every", "11"], "--every is 11; allowed: from 2e-06 to 10 s, for 10 s"),
        (["nosuch"], "unknown scene 'nosuch'"),
    ],
)
def test_what_makes_no_sense_is_a_line_and_writes_nothing(arguments, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["truth", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler on this machine")
def test_the_lines_of_cpp_in_the_docs_read_it(truth, tmp_path):
    file, _ = write_truth(load_scene("double"), truth, tmp_path / "a.csv")
    (tmp_path / "read.cpp").write_text(re.search(r"```cpp\n(.*?)```", PAGE.read_text(), re.DOTALL)[1])
    subprocess.run(["c++", "-std=c++17", "-o", "read", "read.cpp"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "read", file], capture_output=True, text=True, check=True)
    said = re.fullmatch(r"6 times, the last at (\S+) s, the first angle there (\S+)\n", done.stdout)
    assert (float(said[1]), float(said[2])) == (truth.t[-1], truth.theta[-1, 0])
