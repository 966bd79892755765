"""The kind of study `scaling`: its costs, its search for the longest chain in real time, its report."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from pendbench.base.errors import InputError
from pendbench.commands.run import run_study
from pendbench.engines.registry import engine
from pendbench.kinds.scaling.plots import longest_figure
from pendbench.kinds.scaling.search import FINER, Ladder, best_of, nearest_beyond, next_trial, trial_of
from pendbench.kinds.scaling.study import _open, chain_of, measure, titles_of
from pendbench.kinds.scaling.work import RaceRun, StepCost, _memory_taken, measure_race, measure_step_cost
from pendbench.measures.clock import race
from pendbench.measures.coarse_motion import CoarseErrors
from pendbench.measures.known_motion import Known, measure_known
from pendbench.measures.titles import TITLES, Shown, title_of
from pendbench.physics.energy import energy_scale
from pendbench.report.page import Report
from pendbench.report.styles import Styles
from pendbench.scene.scene import Effects, load_scene
from pendbench.study.case import Case
from pendbench.study.plan import load_plan
from pendbench.study.results import Results
from pendbench.study.timing import Timed
from support.oracle import Oracle
from support.reading import cells_of, section
from support.scenes import chain

STUDY = """
title = "Small"
kind = "scaling"
scenes = ["rope100"]
links = [1, 3, 4, 6]
fit_from = 3
duration = 0.02
[[engines]]
name = "analytic"
methods = ["rk4", "euler"]
dt = [1e-3]
[[engines]]
name = "analytic"
methods = ["taylor"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("scaling")
    (path / "small.toml").write_text(STUDY)
    return path


OFF = CoarseErrors(0.5, 0.5, 0.5)
ON, ENERGY = CoarseErrors(0.0, 0.0, 0.0), title_of("energy")


def searched(folder, fastest, steady, stops=math.inf, beyond="too slow", noise=0.0):
    """A report where trials win all titles up to `fastest` links and a step of `steady` / n s, and steps cost
    2 n^1.5 us; with what was raced: method, links, step.
    """
    raced = []

    def race(case, _every, _titles):
        n, dt = case.scene.n, case.dt or 0.0
        raced.append((case.method, n, case.dt))
        lost = 1.0 if dt * n > steady else 0.0
        late = 2.0 if n > fastest and beyond == "too slow" else 0.5
        if not lost and n > fastest and beyond != "too slow":
            return RaceRun(beyond, beyond)
        return RaceRun("ok", "", Shown(1.0, 1.0, late, strays=lost, risen=lost, error=lost, coarse=ON))

    return reported(folder, race, stops, noise), raced


def reported(folder, race, stops=math.inf, noise=0.0):
    """The report of a study whose trials fare as `race` says."""

    def cost(case, _step, _steps):
        n = case.scene.n
        if n >= stops:
            return StepCost("timed out", "x")
        return StepCost("ok", timing=Timed("ok", step_us=2.0 * n**1.5, step_spread=noise))

    plan = load_plan(folder / "small.toml")
    answers = {measure_step_cost: cost, measure_race: race, measure_known: lambda *_: Known("ok")}
    found = measure(plan, Oracle(answers))
    return Report(Results(plan.name, "T", "scaling", found, plan.options, quick=True))


def by_method(report, table, title="energy"):
    rows = [row for row in report.tables[table] if table == "growth" or row.title == title]
    return {row.case.method: row for row in rows}


@pytest.mark.parametrize("fastest", [8, 100, 777, 12_345])
def test_longest_chain_is_found_to_a_tenth(folder, fastest):
    report, _ = searched(folder, fastest=fastest, steady=0.5)
    for row in report.tables["longest"]:
        assert fastest / 1.1 - 1 <= row.longest_n <= fastest
        assert row.longest_n < row.next_n
        assert (row.outcome, row.bound) == ("too slow", False)


def test_step_of_the_longest_chain_is_near_the_coarsest_that_holds(folder):
    rows = by_method(searched(folder, fastest=500, steady=0.05)[0], "longest")
    best = 0.05 / rows["rk4"].longest_n
    assert best / FINER**2 <= rows["rk4"].dt <= best
    assert math.isnan(rows["taylor"].dt)


def test_nothing_is_tried_twice_and_few_trials_do(folder):
    report, raced = searched(folder, fastest=1000, steady=0.05)
    assert len(set(raced)) == len(raced)
    tried = [row.title for row in report.tables["trials"] if row.case.method == "rk4"]
    assert tried.count("faithful") == tried.count("energy") < 25
    assert tried.count("moves well") < 80  # from the coarsest step at each length; those are soon lost


@pytest.mark.parametrize(("divides", "longest"), [(True, 512), (False, 8)])
def test_where_a_method_divides_its_steps_a_finer_one_may_be_faster(divides, longest):
    """Up to 8 links any step is in time, up to 512 those of a third at most, and beyond none."""
    ladder, trials = Ladder(1.0, 1e-3, fixed=True, shrinks=False, divides=divides), []
    while (asked := next_trial(trials, ladder)) is not None:
        n, dt = asked
        late = n > 512 or (n > 8 and dt > 0.35)
        trials.append(trial_of(ENERGY, n, dt, RaceRun("ok", "", Shown(1.0, 1.0, 2.0 if late else 0.5))))
    assert longest / 1.1 <= best_of(trials).n <= longest
    slow = [trial.dt for trial in trials if trial.n == nearest_beyond(trials).n]
    assert len(slow) == (4 if divides else 1)


def test_chain_that_no_step_keeps_is_none(folder):
    report, raced = searched(folder, fastest=1000, steady=0.0)
    rk4 = by_method(report, "longest")["rk4"]
    assert math.isnan(rk4.longest_n)
    assert (rk4.outcome, rk4.bound) == ("lost", False)
    assert min(dt for method, _, dt in raced if method == "rk4") >= 1e-5
    assert {n for method, n, _ in raced if method == "rk4"} == {8, 4, 2, 1}
    assert "no step below 1e-05 s is tried" in rk4.reason


def test_chain_that_is_shorter_than_the_first_tried_is_found(folder):
    report, _ = searched(folder, fastest=3, steady=0.5)
    assert {row.longest_n for row in report.tables["longest"]} == {3}


@pytest.mark.parametrize("outcome", ["refused", "timed out", "out of memory", "crashed"])
def test_length_is_a_bound_where_something_else_than_the_chain_ended_the_search(folder, outcome):
    report, _ = searched(folder, fastest=100, steady=0.5, beyond=outcome)
    for row in report.tables["longest"]:
        assert row.bound
        assert (row.outcome, row.reason) == (outcome, outcome)
        assert f"analytic {row.case.method} {row.longest_n}" not in report.answer


#: Per n / dt, what a second takes; and the step times n, s, up to which the titles are held, in their order.
PRICE, STEADY = 1e-7, (4e-3, 0.05, 0.2)


def titled(case, _every, titles):
    """A run that costs PRICE n / dt, and shows no more than its titles ask for: with any title lost it ends early."""
    n, dt = case.scene.n, case.dt or 1e-4 / case.scene.n
    unfaithful, strays, badly = (n * dt > steady for steady in STEADY)
    spent, lost = PRICE * n / dt, {"faithful": unfaithful or strays, "energy": strays, "moves well": badly}
    reached = 0.5 if all(lost[name] for name in titles) else min(1.0, 1.01 / spent)
    error = 0.5 if unfaithful else 0.0
    coarse = OFF if badly else ON
    return RaceRun(
        "ok",
        "",
        Shown(1.0, reached, reached * spent, strays=0.3 * strays, lost=0.3 * strays, error=error, coarse=coarse),
    )


def test_each_title_has_its_own_longest_chain(folder):
    """With the step steady / n, a second takes PRICE n^2 / steady: so the longest has sqrt(steady / PRICE) links."""
    report = reported(folder, titled)
    for title, steady in zip(TITLES, STEADY, strict=True):
        row, best = by_method(report, "longest", title.name)["rk4"], math.sqrt(steady / PRICE)
        assert best / (1.1 * math.sqrt(FINER)) <= row.longest_n <= best
        assert row.outcome == "too slow"
        assert steady / FINER**2 <= row.dt * row.longest_n <= steady
        assert (row.shown.strays > 0.01) == (title.name == "moves well")


def test_to_move_well_every_length_begins_with_the_coarsest_step(folder):
    """A method whose steps are all that good from afar in chains of 64 links and more, and half of it in shorter."""

    def race(case, _every, _titles):
        n, dt = case.scene.n, case.dt or 0.0
        badly, late = n < 64 and dt > 1 / 480, 2.0 if n > 500 else 0.5
        return RaceRun("ok", "", Shown(1.0, 1.0, late, strays=0.5, error=0.5, coarse=OFF if badly else ON))

    row = by_method(reported(folder, race), "longest", "moves well")["rk4"]
    assert row.dt == 1 / 240
    assert 500 / 1.1 <= row.longest_n <= 500


def test_titles_share_runs(folder):
    raced = {}

    def race(case, every, titles):
        raced.setdefault((case.method, case.scene.n, case.dt), []).append(titles)
        return titled(case, every, titles)

    report = reported(folder, race)
    assert next(iter(raced.values())) == [tuple(title.name for title in TITLES)]
    assert sum(map(len, raced.values())) < len(report.tables["trials"])


def test_a_run_counts_for_each_title_that_it_wins(folder):
    """Of 60 to 300 links none is faithful with any step, but longer ones are with those that keep their energy."""

    def race(case, _every, _titles):
        n = case.scene.n
        return RaceRun("ok", "", Shown(1.0, 1.0, n / 800, error=0.5 if 60 < n < 300 else 0.0, coarse=ON))

    report = reported(folder, race)
    for method in ("rk4", "taylor"):
        row = by_method(report, "longest", "faithful")[method]
        assert 800 / 1.1 <= row.longest_n <= 800
        assert (row.outcome, row.shown.error) == ("too slow", 0.0)


def test_a_run_that_ended_too_early_for_a_title_is_run_again():
    """It lost its energy half way, and what it may still move like is not known."""
    case, (_, energy, well) = Case(chain(1), "analytic", "rk4", 1e-3), TITLES
    early = RaceRun("ok", "", Shown(1.0, 0.5, 0.1, strays=0.5, coarse=ON))
    asked, runs = {(case, energy): (8, 0.1), (case, well): (8, 0.1)}, {(case, 8, 0.1): early}
    assert _open(asked, {}) == {(case, 8, 0.1): [energy, well]}
    assert _open(asked, runs) == {(case, 8, 0.1): [well]}
    assert not _open(asked, {(case, 8, 0.1): RaceRun("crashed")})
    assert not _open(asked, {(case, 8, 0.1): replace(early, shown=replace(early.shown, reached=1.0))})


def test_a_chain_whose_energy_is_lost_may_still_move_well(folder):
    """The sentence and its table say how much of it."""

    def race(case, _every, _titles):
        n = case.scene.n
        return RaceRun("ok", "", Shown(1.0, 1.0, n / 100, strays=0.24, lost=0.24, error=0.0, coarse=ON))

    answer = reported(folder, race).answer
    assert re.search(r"; moves well: analytic \w+ (9[1-9]|100) \(of the energy 24% lost\) links\.", answer)
    for name in ("faithful", "energy"):
        assert re.search(rf"; {name}: analytic \w+ none links", answer)


def test_what_is_not_known_is_a_bound(folder):
    def race(case, _every, _titles):
        error = math.nan if case.scene.n > 50 else 0.0
        return RaceRun("ok", "", Shown(1.0, 1.0, case.scene.n / 100, error=error, coarse=ON))

    report = reported(folder, race)
    faithful, energy = (by_method(report, "longest", name)["rk4"] for name in ("faithful", "energy"))
    assert (faithful.outcome, faithful.bound, energy.bound) == ("not known", True, False)
    assert 50 / 1.1 <= faithful.longest_n <= 50


def test_no_title_is_asked_for_an_energy_that_never_rises_where_something_damps():
    damped = replace(chain(2), effects=Effects(gravity=9.81, joint_damping=0.1))
    assert [title.name for title in titles_of(damped)] == ["faithful", "energy"]
    assert len(titles_of(chain(2))) == 3


def test_length_is_a_bound_where_the_finest_step_ended_the_search(folder):
    rows = by_method(searched(folder, fastest=1e5, steady=2e-3)[0], "longest")
    assert rows["rk4"].bound
    assert "no step below 1e-05 s is tried" in rows["rk4"].reason


def test_links_share_the_step_of_one(folder):
    report, _ = searched(folder, fastest=8, steady=0.5)
    assert [row.case.dt * row.case.scene.n for row in report.cases if row.case.method == "rk4"] == pytest.approx(
        [0.01] * 4
    )


# The report.


def test_the_answer_s_numbers_are_those_of_its_table(folder):
    report, _ = searched(folder, fastest=100, steady=0.5)
    heading, *rows = cells_of(section(report.markdown(), "The answer"))
    shown = {row[0]: dict(zip(heading, row, strict=True)) for row in rows}
    for title in TITLES:
        [name, length] = re.findall(rf"{title.name}: (\w+ \w+) (\d+)", report.answer)[0]
        assert (shown[title.name]["method"], shown[title.name]["longest chain"]) == (name, length)
    [exponent] = re.findall(rf"power of: {name} ([\d.]+) ±", report.answer)
    assert shown["energy"]["exponent"] == exponent == "1.50"


@pytest.mark.parametrize(("noise", "told"), [(0.05, False), (0.2, True)])
def test_noisy_timings_are_said_to_be_noisy(folder, noise, told):
    report, _ = searched(folder, fastest=100, steady=0.5, noise=noise)
    assert ("some timings are noisy" in report.answer) == told
    row = cells_of(section(report.markdown(), "The answer"))[1]
    assert row[-2:] == ["4" if told else "0", "4"]
    assert {row.flags for row in report.cases} == {"noisy timing: spread 20%" if told else ""}


def test_the_quick_variant_says_why_its_chains_are_longer(folder):
    page = searched(folder, fastest=100, steady=0.5)[0].markdown()
    assert "follows 0.02 s, so its chains are longer than those of the full study" in page


def test_longest_chains_have_the_engine_s_colour_and_bounds_are_marked(folder):
    for outcome, told in (("too slow", ""), ("crashed", "at least ")):
        rows = list(searched(folder, fastest=100, steady=0.5, beyond=outcome)[0].tables["longest"])
        styles = Styles.of_cases(row.case for row in rows)
        panels = longest_figure(styles, rows).axes
        assert [axes.get_title() for axes in panels] == [title.name for title in TITLES]
        for axes in panels:
            own = [row for row in rows if row.title == axes.get_title()]
            ordered = sorted(own, key=lambda row: row.longest_n)
            assert [text.get_text() for text in axes.texts] == [f"{told}{row.longest_n}" for row in ordered]
            assert [bar.get_facecolor()[:3] for bar in axes.patches] == [styles.colour(row.case) for row in ordered]
            assert {bool(bar.get_hatch()) for bar in axes.patches} == {bool(told)}


def test_memory_is_that_of_a_run_that_is_there():
    scene = chain(50_000, angle=1.5)
    case = Case(scene, "analytic", "rk4", 1e-9)
    _memory_taken(case, 1e-9)  # which may load kernels
    held = _memory_taken(case, 1e-9)
    assert 50_000 * 8 * 8 < held < 50_000 * 8 * 60  # the scene's arrays are there before
    assert _memory_taken(Case(chain(2), "analytic", "rk4", 1e-3), 1e-3) < 2e6


def test_exponent_is_that_of_the_costs_and_the_end_is_told(folder):
    report, _ = searched(folder, fastest=10, steady=1.0)
    for row in report.tables["growth"]:
        assert row.growth.exponent == pytest.approx(1.5)
        assert row.growth.error < 1e-12
    report, _ = searched(folder, fastest=10, steady=1.0, stops=4)
    for row in report.tables["growth"]:
        assert all(map(math.isnan, (row.n_from, row.n_to, row.growth.exponent)))  # of two lengths there is none
        assert row.status == "timed out"
    assert max(row.case.scene.n for row in report.cases) == 4


def test_exponent_of_an_engine_that_stops_early_is_that_of_its_last_decade(folder):
    for row in searched(folder, fastest=10, steady=1.0, stops=6)[0].tables["growth"]:
        assert row.growth.exponent == pytest.approx(1.5)
        assert (row.n_from, row.n_to) == (1, 4)


def test_a_chain_that_loses_its_energy_has_no_cost():
    case = Case(chain(20, angle=1.5), "analytic", "euler", 0.2)
    found = measure_step_cost(case, 0.2, 100)
    assert found.status != "ok"
    assert math.isnan(found.timing.step_us)


def test_study_from_end_to_end(folder):
    table = run_study(folder / "small.toml", folder / "out", jobs=1)
    assert set(table.status) == {"ok"}
    assert sorted(set(table.n)) == [1, 3, 4, 6]
    assert (table.step_us > 0).all()
    assert (table.error_max < 0.1).all()
    rk4, euler = (table[table.method == method].error_max.max() for method in ("rk4", "euler"))
    assert rk4 < euler
    page = (folder / "out/report.md").read_text()
    assert "## The longest chain in real time" in page
    assert (folder / "out/plots/cost.png").stat().st_size > 1000


def test_pattern_keeps_its_mass_and_its_length():
    pattern = load_scene("rope100")
    for n in (1, 7):
        scene = chain_of(pattern, n, 0.02)
        assert scene.masses.sum() == pytest.approx(pattern.masses.sum())
        assert scene.lengths.sum() == pytest.approx(pattern.lengths.sum())
        assert (scene.n, scene.duration) == (n, 0.02)


def test_race_stops_where_the_energy_is_lost():
    scene = load_scene("chain10")
    analytic, asked = engine("analytic"), []
    found = race(
        analytic,
        scene,
        "rk4",
        0.01,
        {},
        0.1 * np.arange(1, 101),
        lambda _, state: asked.append(state) or len(asked) == 7,
    )
    assert found.lost
    assert found.reached == pytest.approx(0.7)
    assert energy_scale(scene) > 0


def test_race_against_a_method_that_chooses_its_steps():
    found = race(engine("analytic"), load_scene("single"), "taylor", None, {}, np.arange(1.0, 11.0), lambda *_: False)
    assert (found.reached, found.lost) == (10.0, False)
    assert 0 < found.spent < 10


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('["rope100"]', '["rope100", "chain5"]'), "scenes has 2 entries; allowed: 1"),
        (('["rope100"]', '["heavy_tip"]'), "masses differ"),
        (("links = [1, 3, 4, 6]", "links = []"), "links"),
        (("links = [1, 3, 4, 6]", "links = [0]"), "links"),
        (("duration = 0.02", "duration = 0"), "duration"),
        (
            ("duration = 0.02", "duration = 0.02\ncoarsest = 0.1\nfinest = 0.2"),
            "coarsest is 0.1; allowed: finest = 0.2 or more",
        ),
    ],
)
def test_bad_study_is_one_line(folder, change, says):
    path = folder / "bad.toml"
    path.write_text(STUDY.replace(*change))
    with pytest.raises(InputError) as error:
        load_plan(path)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("angle", [0.0, math.pi])
def test_pattern_that_nothing_moves_is_refused(folder, angle):
    chain = f"[chain]\nn = 1\nmass = 1.0\nlength = 1.0\n[start]\nangles = {angle!r}\n"
    (folder / "still.toml").write_text(f'title = "Still"\nduration = 1.0\n{chain}[effects]\ngravity = 9.81\n')
    path = folder / "resting.toml"
    path.write_text(STUDY.replace('"rope100"', '"still.toml"'))
    with pytest.raises(InputError, match="is at rest and nothing pulls it; allowed: one that moves"):
        load_plan(path)


@pytest.mark.parametrize("effect", ["air_drag = {linear = [0.1, 0.2]}", "rod_mass = [0.1, 0.2]", "joint_rest = [0, 1]"])
def test_pattern_of_links_that_have_their_own_effects_is_refused(folder, effect):
    chain = "[chain]\nn = 2\nmass = 1.0\nlength = 1.0\n[start]\nangles = 1.0\n[effects]\njoint_stiffness = 1.0\n"
    (folder / "own.toml").write_text(f"duration = 1.0\n{chain}{effect}\n")
    path = folder / "own_study.toml"
    path.write_text(STUDY.replace('"rope100"', '"own.toml"'))
    with pytest.raises(InputError, match="allowed: effects with one number for all joints"):
        load_plan(path)
