"""`pendbench show` and `pb.show`: what a page is made of, and one line for what cannot be shown."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import pendbench as pb
from pendbench.__main__ import main
from pendbench.commands import takes
from pendbench.commands.butterfly import butterfly
from pendbench.commands.staging import stage_of
from pendbench.commands.takes import LEFT, case_of, default_cases, takes_of
from pendbench.physics.acting import pivot_velocity
from pendbench.physics.geometry import positions
from pendbench.report.styles import engine_hue
from support.browser import Visit, browser


@pytest.fixture(scope="module")
def short():
    """Half a second of a double pendulum, so that its truth takes no time."""
    double = pb.load_scene("double")
    return pb.Scene("short", "A short <b>swing</b>", 0.5, double.masses, double.lengths, double.angles, double.rates,
                    double.effects)  # fmt: skip


@pytest.fixture(scope="module")
def stage(short):
    cases = [
        case_of(short, "mujoco", "euler", 0.01),
        case_of(short, "analytic"),
        case_of(short, "mujoco", "rk4", 0.005),
    ]
    return stage_of(short, takes_of(cases))


def data_of(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


def test_the_acts_are_the_runs_in_the_colours_of_the_plots(stage):
    assert [(act.name, act.detail) for act in stage.acts] == [
        ("mujoco", "euler, step 0.01 s"),
        ("analytic", "adaptive, chooses its steps"),
        ("mujoco", "rk4, step 0.005 s"),
    ]
    assert stage.acts[1].colour == engine_hue("analytic").lower()
    assert len({act.colour for act in stage.acts}) == 3
    assert stage.acts[2].dashes


def test_a_body_is_where_the_run_is(short, stage):
    run = pb.simulate(short, "mujoco", "euler", 0.01)
    body = stage.acts[0].bodies[0]
    expected = positions(short.lengths, run.theta)
    assert (body.t == run.t).all()
    assert (body.places[:, 0] == 0.0).all()
    assert (body.places[:, 1:] == expected).all()


def test_errors_are_those_from_the_truth(short, stage):
    coarse, ours, fine = stage.acts
    truth = pb.reference(short, coarse.bodies[0].t)
    run = pb.simulate(short, "mujoco", "euler", 0.01)
    apart = np.linalg.norm(positions(short.lengths, run.theta) - positions(short.lengths, truth.theta), axis=-1)
    assert np.allclose(coarse.error.values, apart.max(axis=1), rtol=1e-6, atol=1e-15)
    assert coarse.error.values.max() > 1e3 * fine.error.values.max() > 1e3 * ours.error.values.max()
    crossed = np.flatnonzero(coarse.error.values > LEFT)
    assert (coarse.leaves <= coarse.error.t[crossed[0]]) if len(crossed) else np.isnan(coarse.leaves)


def test_a_driven_pivot_is_where_it_is():
    """r_0 = amplitude sin(w t + phase) along y, and the chain hangs from there."""
    kapitza = pb.load_scene("kapitza")
    scene = kapitza.with_(duration=0.3)
    drive = scene.effects.driven_pivot
    body = stage_of(scene, takes_of([case_of(scene, "analytic")]), truth_work=0.0).acts[0].bodies[0]
    height = drive.amplitude * np.sin(drive.angular_frequency * body.t + drive.phase)
    assert np.allclose(body.places[:, 0], np.stack([0.0 * body.t, height], axis=-1))
    assert np.ptp(height) > 0.5 * abs(drive.amplitude)
    rods = np.linalg.norm(np.diff(body.places, axis=1), axis=-1)
    assert np.allclose(rods, scene.lengths)
    speed = np.gradient(body.places[:, 0, 1], body.t)[1:-1]
    assert np.allclose(speed, pivot_velocity(scene, body.t[1:-1])[:, 1], atol=2e-2 * np.abs(speed).max())


def test_energy_that_is_not_conserved_is_balanced():
    damped = pb.load_scene("damped_double")
    scene = pb.Scene("d", "d", 0.5, damped.masses, damped.lengths, damped.angles, damped.rates, damped.effects)
    found = stage_of(scene, takes_of([case_of(scene, "analytic")]))
    assert "balance" in found.energy_says
    assert np.abs(found.acts[0].energy.values).max() < 1e-6  # what the spline leaves of it
    lost = pb.energy(scene, *(getattr(pb.simulate(scene), name) for name in ("theta", "omega")))
    assert abs(lost[-1] - lost[0]) > 1e-3


def test_what_is_said_in_words_is_what_is_drawn(stage):
    assert "the truth is known for 0.5 s" in " ".join(stage.words).lower()
    assert sum("mujoco" in sentence for sentence in stage.words) == 2


def test_show_writes_a_page_and_a_notebook_shows_it(short, tmp_path):
    page = pb.show(short, out=tmp_path / "new" / "page.html")
    assert page.path.read_text("utf-8") == page.html
    assert "A short &lt;b&gt;swing&lt;/b&gt;" in page.html
    assert {"analytic", "mujoco", "pymunk"} <= {act["name"] for act in data_of(page.html)["acts"]}
    assert page._repr_html_().startswith("<iframe")
    assert "allow-same-origin" not in page._repr_html_()
    assert len(repr(page)) < 200


def test_show_takes_runs_of_one_scene(short):
    runs = [pb.simulate(short, "mujoco", "rk4", 0.01), pb.simulate(short, tolerance=1e-8)]
    assert [act["detail"] for act in data_of(pb.show(runs).html)["acts"]] == [
        "rk4, step 0.01 s",
        "adaptive tolerance=1e-08, chooses its steps",
    ]
    assert len(data_of(pb.show(runs[0]).html)["acts"]) == 1


def test_a_run_shows_itself_in_a_notebook_and_one_that_cannot_is_text(short):
    run = pb.simulate(short, "mujoco", "rk4", 0.01)
    assert run._repr_html_().startswith("<iframe")
    assert "A short" in run._repr_html_()
    nowhere = pb.Trajectory(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1))
    assert nowhere._repr_html_() is None
    assert pb.reference(short, [0.0, 0.1])._repr_html_().startswith("<iframe")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ([], "there are no runs"),
        (3, "scene is 3; allowed: a scene, a run, or a list of runs"),
        ([1], "allowed: a scene, a run"),
        ([pb.Trajectory(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1))], "does not say what it is of"),
    ],
)
def test_what_is_no_run_cannot_be_shown(asked, said):
    with pytest.raises(pb.InputError, match=said):
        pb.show(asked)


def test_runs_of_two_scenes_have_no_truth_in_common(short):
    with pytest.raises(pb.InputError, match="different scenes"):
        pb.show([pb.simulate(short, times=[0.1]), pb.simulate("single", times=[0.1])])


def test_the_command_writes_what_python_writes(tmp_path, capsys):
    out = tmp_path / "single.html"
    assert main(["show", "single", "--run", "mujoco:rk4:1/100", "--run", "analytic", "--out", str(out)]) == 0
    assert capsys.readouterr().out.strip() == f"Written: {out}"
    assert [act["detail"] for act in data_of(out.read_text("utf-8"))["acts"]] == [
        "rk4, step 0.01 s",
        "adaptive, chooses its steps",
    ]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing"], "unknown scene 'nothing'"),
        (["single", "--run", "mujco"], "did you mean 'mujoco'?"),
        (["single", "--run", "mujoco:rk5"], "unknown method 'rk5'"),
        (["single", "--run", "mujoco:rk4:fast"], "has the step 'fast'"),
        (["single", "--run", "mujoco:rk4:1:2"], "allowed: an engine, then"),
        (["single", "--run", "mujoco:rk4:-1"], "-1"),
        (["single", "--run", "analytic:rk4:1e-12"], "takes 1e+13 steps to be seen; allowed: 1e-06 s and more"),
        (["single", "--run", "analytic:adaptive:0.1"], "chooses its steps"),
        (["single", "--run", ""], "--run is ''"),
        (["single", "--out", "."], "--out .: is a folder"),
        (["single", "--out", "file/page.html"], "lies below a file"),
        (["single", "--butterfly", "1"], "--butterfly is 1; allowed: 2 to"),
        (["single", "--butterfly", "many"], "--butterfly is 'many'; allowed: a whole number"),
        (["single", "--butterfly", "3", "--run", "mujoco"], "allowed: one of them"),
        (["single", "--gif", "."], "--gif .: is a folder"),
        (["single", "--gif", "x.png"], "--gif x.png: allowed: a name that ends in .gif"),
        (["single", "--strip", "x.gif"], "--strip x.gif: allowed: a name that ends in .png"),
        (["single", "--out", "a", "--gif", "./a"], "--gif a: is --out, too; allowed: a file of its own"),
        (["single", "double"], "'double' after 'single'"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(arguments, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    assert main(["show", *arguments]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_page_does_not_replace_the_scene_it_is_of(tmp_path, capsys):
    scene = tmp_path / "mine.toml"
    scene.write_text(pb.load_scene("single").to_toml())
    before = scene.read_bytes()
    assert main(["show", str(scene), "--out", str(scene)]) == 2
    assert "is what is read; allowed: a file of its own" in capsys.readouterr().err
    assert scene.read_bytes() == before


def test_a_run_that_is_refused_is_a_line_and_not_the_end():
    everything = pb.load_scene("everything")
    refused = case_of(everything, "analytic", "rattle", 1e-3)
    found = stage_of(everything, takes_of([case_of(everything, "analytic"), refused]), truth_work=0.0)
    assert found.acts[1].ended.startswith("refused")
    assert found.acts[1].bodies == ()


def test_a_truth_that_takes_long_is_shown_as_far_as_it_was_computed(short):
    """The work of a step is 2 here; of the two solves, each takes one for each of the 51 times at least."""
    takes = takes_of([case_of(short, "mujoco", "euler", 0.01)])
    found = stage_of(short, takes, truth_work=60.0)
    assert 0.05 < found.truth.horizon < 0.2
    assert found.truth.ends == "the truth was computed up to here"
    assert found.acts[0].error.t[-1] == found.truth.horizon
    assert stage_of(short, takes).truth.horizon == 0.5


def test_neighbours_fan_out(short):
    found = butterfly(short, 5)
    (act,) = found.acts
    assert len(act.bodies) == 5
    assert len({body.colour for body in act.bodies}) == 5
    ends = [body.places[-1] for body in act.bodies]
    assert act.error.values[-1] == pytest.approx(max(np.linalg.norm(end - ends[2], axis=1).max() for end in ends))
    assert 1e-8 < act.error.values[-1] < 1e-4  # half a second is too short to fan out
    assert np.isnan(act.leaves)
    assert act.error.values[0] == pytest.approx(0.5 * 2e-6, rel=1e-3)


def test_a_long_chain_has_methods_that_are_done_in_time():
    found = {case.engine: (case.method, case.dt) for case in default_cases(pb.load_scene("rope200"))}
    assert found["analytic"] == ("frame", 1 / 240)
    assert "heyoka" not in found
    assert found["mujoco"][1] == 1 / 240
    assert "mujoco" not in {
        case.engine for case in default_cases(pb.Scene.chain(n=1001, length=1.0, mass=1.0, angles=1.0, gravity=9.81))
    }
    assert default_cases(pb.load_scene("double"))[0].method == "adaptive"


def test_a_very_long_chain_moves_well_and_has_no_truth():
    """None is computed, which would take hours, and the page says so; moments and points are few."""
    scene = pb.load_scene("rope60000").with_(duration=1.2)
    assert [(case.engine, case.method, case.dt) for case in default_cases(scene)] == [("analytic", "bdf2", 1 / 480)]
    assert next(case.method for case in default_cases(pb.load_scene("rope1000"))) == "frame"
    short = pb.load_scene("rope1001").with_(duration=0.05)
    stage = stage_of(short, takes_of(default_cases(short)))
    assert stage.truth is None
    assert "of more than 1000 links it takes hours; --whole-truth computes it" in stage.error_says
    assert stage.acts[0].bodies[0].places.shape == (25, 160, 2)
    assert np.isnan(stage.acts[0].leaves)
    assert "is not compared with the truth" in stage.words[-1]


def test_of_a_very_long_chain_no_more_moments_are_kept_than_are_drawn(monkeypatch):
    """24 steps of 1001 links: every third of them, and the last."""
    monkeypatch.setattr(takes, "_MOST_ANGLES", 8 * 1001)
    short = pb.load_scene("rope1001").with_(duration=0.05)
    [take] = takes_of(default_cases(short))
    assert take.run.t == pytest.approx(np.arange(0, 25, 3) / 480)
    monkeypatch.setattr(takes, "_MOST_ANGLES", 5 * 1001)
    [take] = takes_of(default_cases(short))
    assert take.run.t == pytest.approx(np.array([0, 5, 10, 15, 20, 24]) / 480)


def test_nothing_to_show_is_one_line():
    everything = pb.load_scene("everything")
    with pytest.raises(pb.InputError, match="nothing moves: analytic: refused"):
        stage_of(everything, takes_of([case_of(everything, "analytic", "rattle", 1e-3)]))


def test_the_page_of_real_runs_moves_and_is_silent(short, tmp_path):
    pb.show(short, out=tmp_path / "page.html")
    with browser() as opened:
        seen = Visit(opened, tmp_path / "page.html")
        seen.page.wait_for_function("() => pendbench.clock.time > 0.1")
        assert seen.complaints == []
        assert len(seen.requests) == 1


@pytest.mark.parametrize("verb", ["show", "truth"])
def test_what_keeps_nothing_does_not_say_that_it_does(verb, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("pendbench.scene.scene.load_scene", stopped)
    assert main([verb, "single"]) == 130
    assert capsys.readouterr().err == "\nstopped; the same line begins anew\n"
