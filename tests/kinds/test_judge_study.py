"""The kind of study `judge`: what it recommends does what was asked for, and what it says is what its tables show."""

from __future__ import annotations

import dataclasses
import math
import re
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import pendbench as pb
from pendbench.base.errors import InputError
from pendbench.commands.judge import _tell
from pendbench.commands.run import Finished
from pendbench.engines.mujoco.model_file import AS_IT_STANDS, ModelFile
from pendbench.engines.registry import engine
from pendbench.kinds.judge import work
from pendbench.kinds.judge.columns import COLUMNS, MethodRow, StandsRow
from pendbench.kinds.judge.work import (
    TRUTH_ENDS,
    File,
    Span,
    Try,
    compared_times,
    file_times,
    measure_span,
    within_truth,
)
from pendbench.physics.geometry import distance
from pendbench.report.columns import Table
from pendbench.scene.scene import load_scene
from pendbench.study.case import Case
from pendbench.study.models import Model
from pendbench.study.timing import UNTIMED
from pendbench.study.truths import KeptTruth
from support.reading import cells_of
from support.scenes import chain

ARM = """
<mujoco model="arm">
  <option timestep="0.004"/>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="upper">
      <joint name="shoulder" axis="0 -1 0"/>
      <inertial pos="0 0 -0.4" mass="1" diaginertia="1e-9 1e-9 1e-9"/>
      <body name="fore" pos="0 0 -0.4">
        <joint name="elbow" axis="0 -1 0"/>
        <inertial pos="0 0 -0.3" mass="0.7" diaginertia="1e-9 1e-9 1e-9"/>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="start" qpos="1.2 0.5"/></keyframe>
</mujoco>
"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "arm.xml"
    path.write_text(ARM)
    return path


@pytest.fixture(scope="module")
def judged(arm, tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    return pb.judge(arm, error=1e-2, until=1.0, engines=["mujoco", "pymunk"], out=folder / "report", jobs=1)


def test_what_is_recommended_meets_the_error_from_scratch(judged, arm):
    scene, goal = load_scene(arm), 1e-2
    reached = judged.table[judged.table.verdict == "good enough"]
    assert {"mujoco"} <= set(reached.engine)
    for row in reached.itertuples():
        times = np.arange(11) * 0.1
        truth, run = pb.reference(scene, times), pb.simulate(scene, row.engine, row.method, row.dt, times)
        error = distance(scene.lengths, truth.theta, run.theta - truth.theta).max()
        assert error <= goal
        assert error == pytest.approx(row.error_max, rel=1e-9) or error < row.error_max  # it is compared oftener


def test_a_step_twice_as_long_would_not_do(judged, arm):
    """The coarsest that is good enough, and not just one that is."""
    scene = load_scene(arm)
    row = next(judged.table[judged.table.method == "rk4"].itertuples())
    times = np.arange(11) * 0.1
    truth, run = pb.reference(scene, times), pb.simulate(scene, "mujoco", "rk4", 2 * row.dt, times)
    assert distance(scene.lengths, truth.theta, run.theta - truth.theta).max() > 1e-2 or 2 * row.dt > 0.01


def test_the_file_as_it_stands_comes_first_with_a_line_to_paste(judged):
    assert judged.answer.startswith("As it stands (euler, 0.004 s), the file follows the truth to 0.01 of the length")
    rows = judged.table[(judged.table.engine == "mujoco") & (judged.table.verdict == "good enough")]
    (pasted,) = re.findall(r"that does: (<option .*?>) \(", judged.answer)
    assert pasted in set(rows.setting)


def test_the_answer_says_what_the_tables_show(judged):
    page = (judged.folder / "report.md").read_text()
    rows = cells_of(page)
    stands = dict(zip(*next(rows[at : at + 2] for at, row in enumerate(rows) if "integrator" in row), strict=True))
    assert f" {stands['follows for, s']} s" in judged.answer
    assert f"is {stands['parted by']};" in judged.answer
    assert f"off by {stands['energy error']} of the scale" in judged.answer


def test_a_file_as_it_stands_moves_as_mujoco_does_with_its_settings(arm):
    file, times = ModelFile(arm), np.arange(6) * 0.2
    stands = pb.simulate(file.model.scene, file, AS_IT_STANDS, 0.004, times)
    same = pb.simulate(file.model.scene, "mujoco", "euler", 0.004, times)
    assert stands.status == "ok"
    assert np.allclose(stands.theta, same.theta, rtol=0, atol=1e-7)  # but for the inertia of 1e-9 that its links have


def test_a_scene_that_is_followed_to_its_end_and_one_that_chaos_ends():
    calm = measure_span(chain(1, duration=10.0), None)
    assert (calm.until, calm.interval, calm.why) == (10.0, 0.1, "the scene's end")
    assert calm.magnified < 50
    wild = measure_span(dataclasses.replace(load_scene("chain5"), duration=20.0), None)
    assert wild.why == "chaos"
    assert wild.until < 20.0
    assert 100 < wild.magnified <= work.MAGNIFIED
    assert measure_span(chain(1, duration=10.0), 3.21).until == pytest.approx(3.2)


def test_all_runs_share_the_times_of_the_comparison_and_a_file_has_its_own_steps():
    span = Span("ok", until=1.0, interval=0.01)
    assert len(compared_times(span)) == 101
    assert compared_times(span)[-1] == 1.0
    own = file_times(span, 0.004)
    assert np.array_equal(own, np.rint(own / 0.004) * 0.004)
    assert len(np.unique(own)) == len(own)
    assert own[-1] == 1.0
    assert np.array_equal(file_times(span, 3.0), [0.0, 3.0])  # one step at least, or nothing would be compared


def test_the_line_to_paste_is_not_broken_by_the_terminal(capsys, tmp_path):
    line = '<option timestep="0.01" integrator="RK4"/>'
    cases = Table("methods", COLUMNS["methods"], [])
    report = SimpleNamespace(answer=f"{'a word ' * 21}{line}", tables={"methods": cases})
    _tell(Finished(report, tmp_path))
    assert line in capsys.readouterr().out


@pytest.mark.parametrize(
    ("run", "model", "magnified", "by"),
    [
        (Try("ok", stays=True), Model("ok", error=1.0, limit=1e-9), 1.0, ""),
        (Try("ok"), Model("ok", error=1e-3, limit=1e-9), 500.0, "the model"),
        (Try("ok"), Model("ok", error=1e-9, limit=1e-9), 3.0, "the step"),
        (Try("ok"), Model("ok", error=1e-9, limit=1e-9), 500.0, "the step, and chaos that makes its errors grow"),
    ],
)
def test_what_parts_a_file_from_the_truth(run, model, magnified, by):
    file = File("arm.xml", "", "euler", 0.002, ())
    assert StandsRow(file, run, model, Span("ok", magnified=magnified)).parted_by == by


@pytest.mark.parametrize("name", ["arm.urdf", "arm.xml"])
def test_the_line_to_paste_sets_the_file(name, tmp_path):
    """In URDF an <option> of its own is ignored by MuJoCo without a word."""
    its, file = engine("mujoco"), File(name, "", "euler", 0.002, ())
    line = StandsRow(file, Try("ok"), Model("ok"), Span("ok")).pasted(its.setting_line("rk4", 0.00625, {}))
    urdf = '<robot name="a"><link name="l"/>{}</robot>'
    text = (urdf if name.endswith("urdf") else "<mujoco>{}<worldbody/></mujoco>").format(line)
    (tmp_path / name).write_text(text)
    option = mujoco.MjModel.from_xml_path(str(tmp_path / name)).opt
    assert (option.timestep, option.integrator) == (0.00625, mujoco.mjtIntegrator.mjINT_RK4)


def test_a_scene_in_which_nothing_moves_recommends_nothing(tmp_path):
    still = chain(1, angle=0.0, name="still")
    found = pb.judge(still, engines="mujoco", out=tmp_path / "report", jobs=1)
    assert found.answer.startswith("Nothing moves in still: it starts at rest, and nothing pulls it.")
    assert "costs least" not in found.answer
    assert found.table.empty


def test_nothing_is_compared_past_the_truth():
    span = Span("ok", until=1.0, interval=0.01, why="as asked for")
    assert within_truth(span, KeptTruth("ok", horizon=1.0)) is span
    shorter = within_truth(span, KeptTruth("ok", horizon=0.555))
    assert (shorter.until, shorter.why) == (pytest.approx(0.55), TRUTH_ENDS)
    for lost in (KeptTruth("ok", horizon=0.0), KeptTruth("timed out")):
        assert math.isnan(within_truth(span, lost).until)


@pytest.mark.parametrize(
    ("status", "reached", "error", "verdict"),
    [
        ("ok", True, 1e-12, "good enough"),
        ("refused", False, math.nan, "refused"),
        ("ok", False, 1e-3, "another system"),
        ("ok", False, 1e-12, "not reached"),
    ],
)
def test_the_verdict_of_a_method(status, reached, error, verdict):
    case = Case(load_scene("double"), "mujoco", "rk4", 0.01)
    row = MethodRow(case, reached, Try(status, "", error_max=0.1), UNTIMED, Model("ok", error=error, limit=1e-11), 1e-3)
    assert row.verdict == verdict


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"error": 0}, "error is 0; allowed: a number from 1e-12 to 0.5 of the chain's length"),
        ({"error": "small"}, "error is 'small'; allowed: a number"),
        ({"until": -1.0}, "until is -1.0; allowed: a number from 1e-09"),
        ({"engines": "bullet"}, "bullet"),
        ({"engines": 5}, "--engines is 5; allowed: the name of an engine, or several"),
        ({"engines": None}, "allowed: the name of an engine, or several"),
    ],
)
def test_what_cannot_be_judged_is_said_in_a_line(arguments, said, tmp_path):
    with pytest.raises(InputError, match=re.escape(said)):
        pb.judge("double", out=tmp_path / "report", **arguments)
    assert not (tmp_path / "report").exists()


@pytest.mark.parametrize("out", ["", 5])
def test_a_folder_that_is_none_is_said_in_a_line(out, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"--out .*; allowed: a folder that can be written"):
        pb.judge("double", out=out)
    assert not list(tmp_path.iterdir())


def test_a_truth_that_takes_too_long_says_what_to_ask_for(tmp_path):
    study = tmp_path / "long.toml"
    study.write_text('title = "Long"\nkind = "judge"\nscenes = ["single"]\ntime_limit = 0.3\n')
    endless = pb.load_scene("single").with_(duration=1e6)
    found = pb.run_study(study, engines="analytic", scenes=endless, out=tmp_path / "report", jobs=1)
    assert "There is no truth to compare with (timed out)" in found.answer
    assert "`--until` asks for less" in found.answer


def test_engines_that_refuse_say_why(tmp_path):
    tiny = pb.Scene.chain(n=2, length=1e-8, mass=1.0, angles=1.0, gravity=9.81, duration=1e-4)
    found = pb.judge(tiny, engines="mujoco", out=tmp_path / "report", jobs=1)
    assert found.answer.startswith("None of the engines that were asked simulates this scene: mujoco says ")
    assert "a rod of 1e-08 m" in found.answer
    assert set(found.table.verdict) == {"refused"}
