"""A study finds what is wrong with engines that are wrong, says so in their rows, and does no harm to the others."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pandas as pd
import pytest

from pendbench.report.tables import data_frame
from support.clock import clocked
from support.controls import CLASSES, install
from support.tiny_study import Inline, run, write_study

HEAD = """
title         = "Which engines are wrong?"
scenes        = ["double.toml"]
starts        = 0
sample        = 0.05
lyapunov_time = 10.0
time_limit    = 3.0
memory_limit  = 1.0
"""

GOOD = """
[[engines]]
name    = "analytic"
methods = ["adaptive"]

[[engines]]
name    = "analytic"
methods = ["rk4"]
dt      = [1e-2, 5e-3]
"""

STEPS = {"heavy": [0.01, 0.005], "misprint": [0.01, 0.005], "half": [0.01, 0.005, 0.0025], "single": [0.01, 0.005]}


def tables() -> str:
    text = ""
    for made in CLASSES:
        method = next(iter(made.methods))
        steps = "" if method == "adaptive" else f"dt = {STEPS.get(made.name, [0.01])}\n"
        text += f'[[engines]]\nname = "{made.name}"\nmethods = ["{method}"]\n{steps}'
    return text


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The tables of a study with every control in it, and of one with the good engines alone."""
    folder = tmp_path_factory.mktemp("controls")
    install(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        here = Path(__file__).parents[1]
        patch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(here)]), prepend=os.pathsep)
        study = write_study(folder, GOOD + tables(), HEAD)
        wrong = run(study, folder / "out", jobs=2, report=True)
    alone = run(write_study(folder, GOOD, HEAD, "good"), folder / "good", Inline)
    return data_frame(wrong.report.cases), data_frame(alone.report.cases), wrong.out


@pytest.fixture(scope="module")
def rows(found):
    return found[0]


def rows_of(rows: pd.DataFrame, engine: str) -> pd.DataFrame:
    its = rows[rows.engine == engine]
    assert len(its) == len(STEPS.get(engine, [0.01]))
    return its


def one(rows: pd.DataFrame, engine: str, name: str):
    """What all rows of an engine have in common."""
    values = set(rows_of(rows, engine)[name])
    assert len(values) == 1, values
    return values.pop()


def told(rows: pd.DataFrame, engine: str) -> list[str]:
    """The flags that all rows of an engine have in common, but for how well it could be timed."""
    flags = [{flag for flag in text.split("; ") if "noisy" not in flag} for text in rows_of(rows, engine)["flags"]]
    return sorted(set.intersection(*flags))


def test_every_control_has_its_rows(rows):
    assert set(rows.engine) == {"analytic", *(made.name for made in CLASSES)}


@pytest.mark.parametrize(("engine", "size"), [("heavy", 1e-3), ("misprint", 1.0)])
def test_another_system_is_told_with_its_size(rows, engine, size):
    assert one(rows, engine, "cause") == "model"
    assert 0.1 * size < one(rows, engine, "model_error") < 10 * size
    assert "another system: accelerations differ by" in " ".join(told(rows, engine))
    assert one(rows, engine, "status") == "ok"
    assert rows_of(rows, engine).error_max.min() > 0.1 * size


def test_another_system_has_an_error_that_no_step_brings_down(rows):
    assert one(rows, "heavy", "plateau") == pytest.approx(rows_of(rows, "heavy").error_half.min(), rel=0.5)
    assert any(flag.startswith("plateau: the error stops at") for flag in told(rows, "heavy"))


def test_a_dropped_half_step_is_told_by_its_order(rows):
    assert one(rows, "half", "order_claimed") == 2
    assert one(rows, "half", "order_observed") == pytest.approx(1.0, abs=0.1)
    assert "order 1.0 where 2 is claimed" in told(rows, "half")
    assert one(rows, "half", "cause") == "integration"
    assert one(rows, "half", "model_error") < 1e-6


def test_single_precision_is_a_plateau(rows):
    assert 1e-8 < one(rows, "single", "plateau") < 1e-5
    assert [flag.partition(" at")[0] for flag in told(rows, "single")] == ["plateau: the error stops"]
    assert one(rows, "single", "cause") == "integration"


def test_who_knows_the_answer_is_too_good(rows):
    assert "too good: the truth, to the last bit" in told(rows, "oracle")
    assert one(rows, "oracle", "error_max") < 1e-14


def test_who_takes_no_steps_is_too_good(rows):
    its = rows[rows.engine == "lazy"]
    assert "too good: 0 steps to 40 different times" in its["flags"].item()


@pytest.mark.parametrize(
    ("engine", "status", "reason"),
    [
        ("lost", "not finite", "an angle or a rate is not finite at t = 1.05 s"),
        ("crashing", "crashed", "the process died of SIGSEGV"),
        ("hanging", "timed out", "took longer than 3 s of processor time"),
        ("misshapen", "error", "state() gave theta (2, 1) and omega (2,); a chain of 2 has (2,)"),
        ("reset", "reset", "its clock is behind"),
        ("raising", "error", "RuntimeError: no opinion"),
        ("picky", "refused", "no chain of 2\\nlinks"),
    ],
)
def test_a_run_that_fails_is_a_row_with_its_status_and_reason(rows, engine, status, reason):
    assert one(rows, engine, "status") == status
    assert one(rows, engine, "reason") == reason


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux only")
def test_a_run_that_takes_too_much_memory_is_a_row_that_names_the_limit(rows):
    assert one(rows, "hungry", "status") == "out of memory"
    assert "MemoryError: Unable to allocate" in one(rows, "hungry", "reason")
    assert one(rows, "hungry", "reason").endswith("; the limit is 1 GB")


def test_a_run_that_prints_a_megabyte_is_a_row_like_any_other(rows):
    assert one(rows, "chatty", "status") == "ok"
    assert set(told(rows, "chatty")) <= {""}
    good = rows[(rows.engine == "analytic") & (rows.dt == 0.01)]
    assert one(rows, "chatty", "error_max") == pytest.approx(good.error_max.item(), rel=1e-3)


def test_a_run_that_fails_has_the_numbers_from_before_and_no_others(rows):
    for engine in ("lost", "reset", "hungry"):
        assert 0 < one(rows, engine, "error_max") < 1e-5
        assert one(rows, engine, "t_1e-3_s") == pytest.approx(1.05), "it left the truth when it ended"
    for engine in ("crashing", "hanging", "misshapen", "raising", "picky"):
        for name in ("error_max", "energy_drift_max", "t_1e-3_s"):
            assert rows_of(rows, engine)[name].isna().all(), (engine, name)
    for engine in ("raising", "picky"):
        assert rows_of(rows, engine)[["step_us", "run_s", "model_error"]].isna().all(axis=None)
    assert "not timed: error, RuntimeError: cannot be built" in told(rows, "raising")
    assert "model not compared: error, RuntimeError: cannot be built" in told(rows, "raising")
    assert one(rows, "raising", "cause") == "not known"


def test_the_good_engines_are_as_they_are_without_the_others(found):
    wrong, alone, _ = found
    names = [name for name in alone if name not in clocked()]
    good = wrong[wrong.engine == "analytic"].reset_index(drop=True)
    assert len(good) == 3
    pd.testing.assert_frame_equal(good[names], alone[names], check_exact=True)
    assert not good["flags"].str.contains("too good|another system|plateau|order", regex=True).any()
    assert set(good.status) == {"ok"}


def test_the_report_tells_all_of_it(found):
    rows, _, out = found
    page = (out / "report.md").read_text()
    for made in CLASSES:
        assert made.name in page
    for status in set(rows.status) - {"ok"}:
        assert status in page
    assert len((out / "cases.csv").read_text().splitlines()) == 1 + len(rows)
