"""Whatever is wrong with a study file is one line: the file, the table, the key, the value, what is allowed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError, MissingEngineError
from pendbench.base.strict import MAX_LINES, read_toml, validate
from pendbench.engines.registry import engine, engine_names, only_by_name
from pendbench.scene.scene import load_scene
from pendbench.study.absent import why_absent
from pendbench.study.kinds import kind
from pendbench.study.plan import Plan, find_study, load_plan
from support.writing import text, toml

SHORT = """
duration = 0.05
[chain]
n = 1
mass = 1.0
length = 1.0
[start]
angles = 0.5
[effects]
gravity = 9.81
"""
TOP = """
title  = "A study"
scenes = ["double"]
"""
ENGINE = """
[[engines]]
name    = "analytic"
methods = ["rk4"]
dt      = [1e-2]
"""
GOOD = TOP + ENGINE
ADAPTIVE = GOOD.replace('["rk4"]', '["adaptive"]').replace("dt      = [1e-2]", "tolerance = 1e-9")
TUNED = GOOD.replace("analytic", "pymunk").replace('["rk4"]', '["tuned"]') + "iterations = 50\n"

EVERYTHING = """
title         = "A study"
kind          = "chaos"
scenes        = ["double", "triple"]
time_limit    = 5.0
memory_limit  = 2
starts        = 2
perturbation  = 0.1
seed          = 5
sample        = 0.1
order_time    = 1.0
lyapunov_time = 30

[[engines]]
name    = "analytic"
methods = ["adaptive", "rk4"]
dt      = [1e-2, 1]
tolerance = [1e-9, 1e-6]

[[engines]]
name       = "pymunk"
methods    = ["default", "tuned"]
dt         = [1e-3]
iterations = 50

[quick]
starts = 0
scenes = ["single"]

[[quick.engines]]
name    = "mujoco"
methods = ["rk4"]
dt      = [1e-3]
"""


@pytest.fixture
def write(tmp_path):
    def write(text: str | bytes) -> Path:
        path = tmp_path / "mine.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def changed(old: str, new: str, text: str = GOOD) -> str:
    assert text.count(old) == 1
    return text.replace(old, new)


def refusal(path: object, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        load_plan(path, **options)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert len(message) <= MAX_LINES
    return message


# What a study file stands for.


def test_a_plan_holds_every_scene_with_every_method_step_and_setting(write):
    plan = load_plan(write(EVERYTHING))
    assert [str(case) for case in plan.cases if case.scene.name == "triple"] == [
        "triple analytic adaptive tolerance=1e-09",
        "triple analytic adaptive tolerance=1e-06",
        "triple analytic rk4 dt=0.01",
        "triple analytic rk4 dt=1",
        "triple pymunk default dt=0.001 iterations=50",
        "triple pymunk tuned dt=0.001 iterations=50",
    ]
    assert len(plan.cases) == 12
    assert [scene.name for scene in plan.scenes] == ["double", "triple"]
    assert (plan.options.time_limit, plan.options.memory_limit) == (5.0, 2.0)
    assert (plan.name, plan.quick, plan.options.starts, plan.options.seed) == ("mine", False, 2, 5)
    assert all(isinstance(value, int) for case in plan.cases for name, value in case.settings if name == "iterations")
    assert all(isinstance(case.dt, float) for case in plan.cases if case.dt is not None)


def test_a_quick_plan_changes_what_its_table_names_and_nothing_else(write):
    path = write(EVERYTHING)
    plan = load_plan(path, quick=True)
    assert [str(case) for case in plan.cases] == ["single mujoco rk4 dt=0.001"]
    assert (plan.options.starts, plan.options.seed, plan.quick) == (0, 5, True)
    assert plan.digest != load_plan(path).digest


def test_a_study_without_a_quick_table_has_the_same_plan(write):
    path = write(GOOD)
    assert [*map(str, load_plan(path, quick=True).cases)] == [*map(str, load_plan(path).cases)]


def test_only_the_engines_that_are_asked_for(write):
    plan = load_plan(write(EVERYTHING), engines=["pymunk"])
    assert {case.engine for case in plan.cases} == {"pymunk"}
    assert len(plan.cases) == 4
    missing = changed('"analytic"', '"not_installed"', EVERYTHING)
    assert len(load_plan(write(missing), engines=["pymunk"]).cases) == 4  # the others need not even be there
    message = refusal(write(EVERYTHING), engines=["analytic", "pymonk"])
    assert "--engines: unknown engine 'pymonk'; did you mean 'pymunk'? allowed: analytic, pymunk (" in message


def test_a_table_can_be_for_some_of_the_scenes(write):
    own = ENGINE.replace("analytic", "mujoco") + 'scenes = ["triple"]'
    path = write(changed('["double"]', '["double", "triple"]') + own)
    assert [f"{case.scene.name} {case.engine}" for case in load_plan(path).cases] == [
        "double analytic",
        "triple analytic",
        "triple mujoco",
    ]
    assert [case.scene.name for case in load_plan(path, engines=["mujoco"]).cases] == ["triple"]
    wrong = own.replace("rk4", "rk5")
    path.write_text(path.read_text().replace(own, wrong))
    message = refusal(path, engines=["mujoco"])
    assert " [engines number 2]: unknown method" in message, "the number is not the table's in the file"


def test_scenes_are_found_beside_the_study(write, tmp_path, monkeypatch):
    (tmp_path / "own.toml").write_text((bundled("models") / "single.toml").read_text())
    path = write(changed('"double"', '"own.toml"'))
    assert load_plan(path).scenes[0].name == "own"
    monkeypatch.chdir(tmp_path)
    assert load_plan("mine.toml").scenes[0].name == "own"


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("name", [path.stem for path in bundled("studies").glob("*.toml")])
def test_every_bundled_study_has_a_plan(name, quick):
    plan = load_plan(name, quick=quick)
    assert plan.cases
    assert {case.engine for case in plan.cases} >= {"analytic", "mujoco", "pymunk"}


# What a study file leaves out, and other scenes.


def test_a_study_file_needs_only_its_scenes(write):
    plan = load_plan(write('kind = "stability"\nscenes = ["double", "fast_spin"]'))
    assert (plan.name, plan.options.title) == ("mine", None)
    installed = {name for name in engine_names() if not only_by_name(name) and not why_absent([name], apart=False)}
    assert {case.engine for case in plan.cases} == installed
    for name in installed:
        found = {(case.method, case.dt) for case in plan.cases if (case.scene.name, case.engine) == ("double", name)}
        methods = engine(name).methods.items()
        assert found == {
            (key, dt) for key, its in methods for dt in ((None,) if its.adaptive else (2e-2, 1 / 240, 1e-3))
        }


def test_an_engine_that_runs_only_by_name_is_there_when_it_is_named(write):
    path = write('kind = "stability"\nscenes = ["double"]')
    assert {case.engine for case in load_plan(path, engines=["scipy"]).cases} == {"scipy"}


def test_steps_by_default_are_those_that_a_scene_is_long_enough_for(tmp_path, write):
    (tmp_path / "short.toml").write_text(SHORT)
    text = 'scenes = ["short.toml", "double"]\n[[engines]]\nname = "mujoco"\nmethods = ["rk4"]'
    steps = {scene: [case.dt for case in load_plan(write(text)).cases if case.scene.name == scene] for scene in
             ("short", "double")}  # fmt: skip
    assert steps == {"short": [1e-3, 1e-4], "double": [1e-2, 1e-3, 1e-4]}


@pytest.mark.parametrize("name", bundled_names("studies"))
@pytest.mark.parametrize("quick", [True, False])
def test_every_bundled_study_takes_other_scenes(name, quick):
    other = replace(load_scene("everything" if name == "effects" else "double"), name="other")
    own, plan = load_plan(name, quick=quick), load_plan(name, quick=quick, scenes=[other])
    assert {case.scene for case in plan.cases} == {other}
    assert {(case.engine, case.method) for case in plan.cases} == {(case.engine, case.method) for case in own.cases}
    assert len(set(plan.cases)) == len(plan.cases)


def test_a_scene_that_the_study_knows_keeps_what_the_study_says_of_it():
    scenes = [load_scene("chain50"), replace(load_scene("double"), name="other")]
    plan = load_plan("cost", scenes=scenes)
    assert list(plan.options.windows) == ["chain50"]
    assert plan.options.long_runs is None
    own = [str(case) for case in load_plan("cost").cases if case.scene.name == "chain50"]
    assert [str(case) for case in plan.cases if case.scene.name == "chain50"] == own
    assert load_plan("cost", scenes=[load_scene("double")]).options.long_runs.scenes == ["double"]
    assert list(load_plan("cost", quick=True, scenes=scenes).options.windows) == ["chain50"]


@pytest.mark.parametrize(
    ("kind", "names", "said"),
    [
        ("chaos", ["double", "double"], "--scenes has 'double' twice; allowed: each name once"),
        ("scaling", ["double", "triple"], "scenes has 2 entries; allowed: 1, the pattern of all chains"),
        ("ensemble", ["triple"], "scenes has 'triple'; allowed: a double pendulum at rest, with gravity"),
        ("effects", ["double"], "scenes has none with an effect to price; allowed: at least one of its scenes with"),
    ],
)
def test_other_scenes_that_a_study_cannot_use(kind, names, said):
    assert said in refusal(kind, scenes=[load_scene(name) for name in names])


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("judge", "scene 'long' lasts 1e+08 s; allowed: up to 1e+06 s, 1e+12 steps of 1e-06 s"),
        ("cost", "scene 'long' lasts 1e+08 s; allowed: up to 5e+07 s, 1e+12 steps of 5e-05 s"),
        ("chaos", "sample is 0.01; allowed: from 100 s, for the 1e+08 s of scene 'long', or a scene of up to 10000 s"),
    ],
)
def test_a_scene_that_is_too_long_is_told_so_and_no_table_that_nobody_wrote(kind, said):
    long = replace(load_scene("double"), name="long", duration=1e8)
    assert refusal(kind, scenes=[long]).endswith(f"{kind}.toml: {said}")


def test_a_scene_too_long_for_steps_that_its_study_does_not_name(tmp_path, write):
    (tmp_path / "long.toml").write_text(SHORT.replace("0.05", "2e8"))
    allowed = "allowed: up to 1e+08 s, 1e+12 steps of 0.0001 s"
    for engines in ("", "\n[[engines]]\nname = 'mujoco'"):
        path = write(f'scenes = ["long.toml"]{engines}')
        assert refusal(path).endswith(f"mine.toml: scene 'long' lasts 2e+08 s; {allowed}")


@pytest.mark.parametrize("name", ["arm.xml", "there/arm.URDF"])
def test_a_model_is_no_study(name):
    instead = f"pendbench judge {name}, or pendbench study chaos --scenes {name}"
    assert refusal(name) == f"{name}: this is a model, not a study; to study it: {instead}"


# What can be wrong. A path stands for the file, so `: ` begins what is said of its top level.

AT = " [engines number 1]: "
WRONG = {
    "key": ("titel = 1\n" + GOOD, ": unknown key 'titel'; did you mean 'title'? allowed: engines, kind,"),
    "title": (changed('"A study"', "5"), ": title is 5; allowed: text in quotes"),
    "title of two lines": (changed("A study", "A\\nB"), "title is 'A\\\\nB'; allowed: one line of 1 to 200 characters"),
    "kind": ('kind = "caos"\n' + GOOD, ": unknown kind 'caos'; did you mean 'chaos'? allowed: chaos"),
    "kind, a number": ("kind = 5\n" + GOOD, ": unknown kind '5'; allowed: chaos"),
    "kind, a list": ('kind = ["chaos"]\n' + GOOD, ": unknown kind 'a list of 1'; allowed: chaos"),
    "kind, a table": ("kind = {}\n" + GOOD, ": unknown kind 'a table'; allowed: chaos"),
    "no scenes": (changed('scenes = ["double"]\n', ""), ": missing key 'scenes'"),
    "empty scenes": (changed('["double"]', "[]"), ": scenes is an empty list; allowed: 1 or more entries"),
    "scenes, a text": (changed('["double"]', '"double"'), ": scenes is 'double'; allowed: a list"),
    "scenes, a number": (changed('["double"]', "[1]"), ": scenes, entry 1, is 1; allowed: text in quotes"),
    "unknown scene": (
        changed('["double"]', '["triple", "doubel"]'),
        ": scenes, entry 2: unknown scene 'doubel'; did you mean 'double'? allowed: ",
    ),
    "missing scene": (changed('"double"', '"nosuch.toml"'), ": scenes, entry 1: nosuch.toml: no such file, in "),
    "scene, a folder": (changed('"double"', '"./"'), ": scenes, entry 1: "),
    "scene twice": (
        changed('["double"]', '["double", "double"]'),
        ": scenes has 'double' twice; allowed: each name once",
    ),
    "empty engines": (TOP + "engines = []", ": engines is an empty list; allowed: 1 or more entries"),
    "engines, a table": (TOP + "[engines]\nname = 'analytic'", ": engines is a table; allowed: a list"),
    "engine": (changed("analytic", "analitic"), AT + "unknown engine 'analitic'; did you mean 'analytic'?"),
    "engine, a number": (changed('"analytic"', "1"), AT + "name is 1; allowed: text in quotes"),
    "no name": (changed('name    = "analytic"\n', ""), AT + "missing key 'name'"),
    "method": (changed('"rk4"', '"rk5"'), AT + "unknown method 'rk5'; did you mean 'rk4'? allowed: "),
    "optional engine": (
        changed('"analytic"', '"analytik"\noptional = true'),
        AT + "unknown engine 'analytik'; did you mean 'analytic'? allowed: ",
    ),
    "empty methods": (changed('["rk4"]', "[]"), AT + "methods is an empty list; allowed: 1 or more"),
    "methods, a text": (changed('["rk4"]', '"rk4"'), AT + "methods is 'rk4'; allowed: a list"),
    "methods, a number": (changed('["rk4"]', "[4]"), AT + "methods, entry 1, is 4; allowed: text in qu"),
    "method twice": (changed('["rk4"]', '["rk4", "rk4"]'), AT + "asks twice for double analytic rk4 dt="),
    "dt, one number": (changed("[1e-2]", "1e-2"), AT + "dt is 0.01; allowed: a list"),
    "empty dt": (changed("[1e-2]", "[]"), AT + "dt is an empty list; allowed: 1 or more entries"),
    "dt, a table": (changed("[1e-2]", "{ a = 1 }"), AT + "dt is a table; allowed: a list"),
    "dt twice": (changed("[1e-2]", "[1e-2, 0.01]"), AT + "asks twice for double analytic rk4 dt=0.01"),
    "dt, too long": (
        changed("[1e-2]", "[20.0]"),
        AT + "dt is 20; allowed: 1e-11 to 10 s, for the 10 s of scene 'double'",
    ),
    "dt, adaptive": (
        changed('["rk4"]', '["adaptive"]'),
        AT + "dt is given; allowed: no dt, since method 'adaptive' chooses its steps",
    ),
    "table twice": (GOOD + ENGINE, " [engines number 2]: asks twice for double analytic rk4 dt=0.01"),
    "scenes of a table": (
        GOOD + 'scenes = ["doubel"]',
        AT + "scenes: unknown scene 'doubel'; did you mean 'double'? allowed: double (the study's scenes)",
    ),
    "empty scenes of a table": (GOOD + "scenes = []", AT + "scenes is an empty list; allowed: 1 or more entries"),
    "a scene without engines": (
        changed('["double"]', '["double", "triple"]') + 'scenes = ["triple"]',
        ": scenes has 'double', and no table of [[engines]] is for it",
    ),
    "setting": (
        changed("tolerance", "tolerence", ADAPTIVE),
        AT + "unknown key 'tolerence'; did you mean 'tolerance'? allowed: dt, methods,",
    ),
    "setting of another method": (GOOD + "tolerance = 1e-9", AT + "unknown key 'tolerance'; allowed: dt,"),
    "setting twice": (changed("1e-9", "[1e-9, 1e-9]", ADAPTIVE), AT + "asks twice for double analytic ada"),
    "starts": ("starts = -1\n" + GOOD, ": starts is -1; allowed: 0 or more"),
    "starts, a fraction": ("starts = 1.5\n" + GOOD, ": starts is 1.5; allowed: a whole number"),
    "seed": ("seed = -1\n" + GOOD, ": seed is -1; allowed: 0 or more"),
    "perturbation": ("perturbation = nan\n" + GOOD, ": perturbation is nan; allowed: a finite number"),
    "time_limit": ("time_limit = 0\n" + GOOD, ": time_limit is 0; allowed: above 0"),
    "memory_limit": ("memory_limit = 0.4\n" + GOOD, ": memory_limit is 0.4; allowed: 0.5 or more"),
    "memory_limit, a text": ('memory_limit = "4 GB"\n' + GOOD, ": memory_limit is '4 GB'; allowed: a number"),
    "memory_limit, no number": ("memory_limit = nan\n" + GOOD, ": memory_limit is nan; allowed: a finite number"),
    "sample": ("sample = 0\n" + GOOD, ": sample is 0; allowed: above 0"),
    "sample, too short": (
        "sample = 1e-300\n" + GOOD,
        ": sample is 1e-300; allowed: from 1e-05 s, for the 10 s of scene 'double'",
    ),
    "sample, too long": ("sample = 1001\n" + GOOD, ": sample is 1001; allowed: at most 1000"),
    "quick, a text": ('quick = "x"\n' + GOOD, ": quick is 'x'; allowed: a table"),
    "quick, a key": (GOOD + "[quick]\nstart = 1", " [quick]: unknown key 'start'; did you mean 'starts'? allowed:"),
    "quick, a value": (GOOD + "[quick]\nstarts = 'x'", " [quick]: starts is 'x'; allowed: a whole number"),
    "quick, its kind": (GOOD + "[quick]\nkind = 'chaos'", " [quick]: a quick study cannot change 'kind'"),
    "quick, itself": (GOOD + "[quick.quick]\n", " [quick]: a quick study cannot change 'quick'"),
    "not TOML": ("title = \n", ": not TOML: "),
    "nothing": ("", ": missing key 'scenes'"),
    "a scene": (
        "duration = 1\n[chain]\nn = 1",
        ": this is a scene, not a study; to study it: pendbench judge ",
    ),
    "not text": (b"\xff\xfe", ": not UTF-8: byte 0xff (at line 1)"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said_in_one_line(write, case):
    text, said = WRONG[case]
    path = write(text)
    message = refusal(path)
    assert message.startswith(str(path))
    assert said in message


@pytest.mark.parametrize(
    "step",
    [
        "0",
        "0.0",
        "-1e-3",
        "nan",
        "inf",
        '"1e-3"',
        "true",
        "[1e-3]",
        "1e-9",
        "1e4",
        "1" + "0" * 400,
        '"1/0"',
        '"1/1e3"',
        '"-1/60"',
        '"1/60 s"',
        '"1/10000000"',
        '"/60"',
        '"0 Hz"',
        '"-60 Hz"',
        '"60 hertz"',
        '"1/60 Hz"',
        '"1e3 Hz"',
        '"2000000 Hz"',
    ],
)
def test_a_step_is_a_number_in_its_range(write, step):
    message = refusal(write(changed("[1e-2]", f"[1e-2, {step}]")))
    assert "mine.toml [engines number 1]: dt, entry 2, is " in message
    allowed = 'a number from 1e-06 to 1000 s, or in quotes a fraction, as "1/60", or a rate, as "60 Hz"'
    assert message.endswith(f"; allowed: {allowed}")


@pytest.mark.parametrize(
    ("step", "value"),
    [('"1/60"', 1 / 60), ('" 1 / 3 "', 1 / 3), ('"3/100"', 0.03), ('"60 Hz"', 1 / 60), ('"59.94Hz"', 1 / 59.94)],
)
def test_a_step_may_be_a_fraction_or_a_rate(write, step, value):
    plan = load_plan(write(changed("[1e-2]", f"[{step}]")))
    assert {case.dt for case in plan.cases if case.dt is not None} == {value}


@pytest.mark.parametrize(
    ("study", "table", "key"),
    [("effects", None, "price_step"), ("stability", None, "finest"), ("scaling", None, "step"),
     ("scaling", None, "coarsest"), ("scaling", None, "finest"), ("cost", "long_runs", "dt")],
)  # fmt: skip
def test_every_step_of_a_study_may_be_a_fraction_or_a_rate(study, table, key):
    data = read_toml(find_study(study))
    for step in ("1/240", "240 Hz"):
        changed = {**data, table: {**data[table], key: step}} if table else {**data, key: step}
        options = validate(kind(study).Options, changed, "mine.toml")
        assert getattr(getattr(options, table) if table else options, key) == 1 / 240


@pytest.mark.parametrize(
    "value", ["0", "1", "nan", "inf", '"x"', "true", "{ a = 1 }", "[]", "[1e-3, [1]]", "[1e-3, 'x']"]
)
def test_a_setting_is_a_number_in_its_range(write, value):
    message = refusal(write(changed("1e-9", value, ADAPTIVE)))
    assert "mine.toml [engines number 1]: tolerance is " in message
    assert message.endswith("; allowed: a number, or a list of them, from 1e-15 to 0.01")


@pytest.mark.parametrize("value", ["0", "1.5", "1e9", "nan", "false", "1" + "0" * 400, "[50, 0]"])
def test_a_whole_setting_is_a_whole_number_in_its_range(write, value):
    message = refusal(write(changed("50", value, TUNED)))
    assert "mine.toml [engines number 1]: iterations is " in message
    assert message.endswith("; allowed: a whole number, or a list of them, from 1 to 100000")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[quick]\nscenes = ["nosuch"]', " [quick]: scenes, entry 1: unknown scene 'nosuch'; allowed: "),
        ("[quick]\nsample = 1e-7", " [quick]: sample is 1e-07; allowed: "),
        (
            '[[quick.engines]]\nname = "mujco"\nmethods = ["rk4"]',
            " [quick] [engines number 1]: unknown engine 'mujco'; did you mean 'mujoco'?",
        ),
    ],
)
def test_what_is_wrong_in_the_quick_table_is_said_of_the_quick_table(write, text, said):
    assert said in refusal(write(GOOD + text), quick=True)


def test_a_study_that_is_not_there_is_said_to_be_so(tmp_path):
    assert "unknown study 'chaoz'; did you mean 'chaos'? allowed: " in refusal("chaoz")
    assert refusal("chaoz").endswith(", or a path that ends in .toml")
    assert "no such file" in refusal(tmp_path / "nosuch.toml")
    assert "a folder, not a file" in refusal(tmp_path)
    assert "not a path" in refusal("a\0.toml")
    assert refusal("a\n/b.toml") == "a\\n/b.toml: no such file"
    for thing in (5, None, 1.5, ["chaos"]):
        assert "is neither the name of a study nor a path" in refusal(thing)
    assert find_study(b"chaos") == find_study("chaos")


# Whatever a file holds: a plan or one line.

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.dates() | st.binary(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=4,
)
KEYS = ["title", "kind", "scenes", "engines", "quick", "starts", "sample", "seed", "perturbation", "order_time"]
KEYS += ["time_limit", "name", "methods", "dt", "iterations", "tolerance", "windows", "accuracies", "long_runs"]
NAMES = ["analytic", "mujoco", "pymunk", "rk4", "euler", "adaptive", "tuned", "double", "triple", "chaos", "cost"]
WORDS = st.sampled_from([*KEYS, *NAMES, "double.toml", "../models/double.toml"])
NUMBERS = st.sampled_from([0, 1, -1, 5, 1e-2, 1e-3, 1e-300, 1e300, float("nan"), float("inf"), 10**400, True])
LIKELY = st.recursive(WORDS | NUMBERS, lambda inner: st.lists(inner, max_size=3), max_leaves=4)
TABLE = st.dictionaries(WORDS, LIKELY | VALUES, max_size=5)
FILE = st.dictionaries(WORDS, LIKELY | VALUES | TABLE | st.lists(TABLE, max_size=3), max_size=5)


def plan_or_line(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    for quick in (False, True):
        try:
            plan, message = load_plan(path, quick=quick), None
        except InputError as error:
            plan, message = None, str(error)
        if message is None:
            assert isinstance(plan, Plan)
            assert plan.cases
            assert len(plan.digest) == 16
        else:
            assert len(message.splitlines()) == 1
            assert len(message) <= MAX_LINES


FEW = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@FEW
@given(FILE)
@example({"title": "T", "scenes": ["double"], "engines": [{"name": "analytic", "methods": ["adaptive"]}]})
@example({"title": "T", "scenes": ["double"], "engines": [{"name": "analytic", "methods": ["rk4"], "dt": [10**400]}]})
@example(
    {"title": "T", "scenes": ["double"], "kind": "cost", "engines": [{"name": "analytic", "methods": ["adaptive"]}]}
)
@example({"quick": {"quick": 1}, "title": "T"})
def test_any_table_is_a_plan_or_one_line(tmp_path, tables):
    lines = "\n".join(f"{text(key)} = {toml(value)}" for key, value in tables.items())
    plan_or_line(tmp_path / "any.toml", lines.encode("utf-8", "surrogatepass"))


@FEW
@given(st.data())
def test_a_study_with_some_bytes_changed_is_a_plan_or_one_line(tmp_path, data):
    content = bytearray(EVERYTHING.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(content) - 1))
        change = data.draw(st.sampled_from(["put", "cut", "copy"]))
        if change == "put":
            content[place] = data.draw(st.integers(0, 255))
        elif change == "cut":
            del content[place : place + data.draw(st.integers(1, 12))]
        else:
            content[place:place] = content[place : place + data.draw(st.integers(1, 40))]
    plan_or_line(tmp_path / "any.toml", bytes(content))


def test_an_optional_engine_that_is_not_installed_is_left_out_and_said(tmp_path, monkeypatch):
    from pendbench.study import absent, cases

    found = absent.engine

    def without_mujoco(name):
        if name == "mujoco":
            raise MissingEngineError("engine 'mujoco' cannot be loaded")
        return found(name)

    for module in (absent, cases):
        monkeypatch.setattr(module, "engine", without_mujoco)
    text = """
title = "t"
scenes = ["double"]
[[engines]]
name = "analytic"
methods = ["adaptive"]
[[engines]]
name = "mujoco"
methods = ["rk4"]
dt = [1e-2]
"""
    study = tmp_path / "study.toml"
    study.write_text(text + "optional = true\n")
    plan = load_plan(study)
    assert {case.engine for case in plan.cases} == {"analytic"}
    assert list(plan.absent) == ["mujoco"]
    study.write_text(text)
    with pytest.raises(InputError, match="mujoco"):
        load_plan(study)
