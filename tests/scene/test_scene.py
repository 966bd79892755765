"""Scenes: what a file and what Python may make one of, and what both refuse in one line."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import pickle
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError
from pendbench.effects import names
from pendbench.scene.masses import MASS
from pendbench.scene.not_yet import NOT_YET
from pendbench.scene.scene import ANGLE, LENGTH, MAX_LINKS, RATE, Effects, Scene, load_scene

TOP = 'title = "Two"\nduration = 5'
CHAIN = "[chain]\nmasses = [1, 2.5]\nlengths = [0.5, 1]"
START = "[start]\nangles = [0.1, 0.2]\nrates = [1, -1]"
EFFECTS = "[effects]\ngravity = 9.81"


def scene_text(top: str = TOP, chain: str = CHAIN, start: str = START, effects: str = EFFECTS) -> str:
    return "\n".join((top, chain, start, effects))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def loaded(text: str | bytes) -> Scene:
    Path("two.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_scene("two.toml")


def complaint(make: Any, *arguments: Any, **named: Any) -> str:
    with pytest.raises(InputError) as caught:
        make(*arguments, **named)
    message = str(caught.value)
    assert len(message) <= 800
    assert message.isprintable()
    return message


def scene(**changes: Any) -> Scene:
    content: dict[str, Any] = {
        "name": "two",
        "title": "Two",
        "duration": 5.0,
        "masses": [1.0, 2.5],
        "lengths": [0.5, 1.0],
        "angles": [0.1, 0.2],
        "rates": [1.0, -1.0],
        "effects": Effects(gravity=9.81),
    }
    return Scene(**{**content, **changes})


# --- files -----------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("here")
def test_a_file_says_what_the_scene_is() -> None:
    found = loaded(scene_text())
    assert (found.name, found.title, found.duration, found.n) == ("two", "Two", 5.0, 2)
    assert found.effects == Effects(gravity=9.81)
    assert found.digest == scene().digest
    for field, values in (("masses", [1, 2.5]), ("lengths", [0.5, 1]), ("angles", [0.1, 0.2]), ("rates", [1, -1])):
        np.testing.assert_array_equal(getattr(found, field), values, strict=False)
        assert getattr(found, field).dtype == np.float64


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("chain", "masses", "lengths"),
    [
        ("n = 3\nmass = 2\nlength = 0.5", [2, 2, 2], [0.5, 0.5, 0.5]),
        ("masses = [1, 2]\nlength = 0.5", [1, 2], [0.5, 0.5]),
        ("mass = 1\nlengths = [1, 2]", [1, 1], [1, 2]),
        ("n = 2\nmasses = [1, 2]\nlength = 0.5", [1, 2], [0.5, 0.5]),
        ("n = 2\nmasses = [1, 2]\nlengths = [3, 4]", [1, 2], [3, 4]),
        ("n = 1\nmass = 1e50\nlength = 1e-50", [1e50], [1e-50]),
    ],
)
def test_numbers_and_lists_in_a_chain(chain: str, masses: list[float], lengths: list[float]) -> None:
    found = loaded(scene_text(chain=f"[chain]\n{chain}", start="[start]\nangles = 1"))
    np.testing.assert_array_equal(found.masses, masses)
    np.testing.assert_array_equal(found.lengths, lengths)
    np.testing.assert_array_equal(found.angles, np.ones(len(masses)))
    np.testing.assert_array_equal(found.rates, np.zeros(len(masses)))


@pytest.mark.usefixtures("here")
def test_the_longest_chain() -> None:
    chain = f"[chain]\nn = {MAX_LINKS}\nmass = 1\nlength = 1"
    assert loaded(scene_text(chain=chain, start="[start]\nangles = 1\nrates = 2")).rates.sum() == 2 * MAX_LINKS


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("effects", ["", "[effects]"])
def test_an_effect_that_is_not_named_does_not_act(effects: str) -> None:
    assert loaded(scene_text(effects=effects)).effects.named() == ()


@pytest.mark.usefixtures("here")
def test_gravity_of_zero_is_an_effect() -> None:
    assert loaded(scene_text(effects="[effects]\ngravity = 0")).effects == Effects(gravity=0.0)
    assert Effects(gravity=0.0).named() == ("gravity",)


@pytest.mark.usefixtures("here")
def test_without_a_title_the_name_is_the_title() -> None:
    assert loaded(scene_text(top="duration = 1")).title == "two"


@pytest.mark.usefixtures("here")
def test_every_effect_can_be_named_in_a_file() -> None:
    message = complaint(loaded, scene_text(effects="[effects]\nzzzzzz = 1"))
    names = ", ".join(sorted(field.name for field in dataclasses.fields(Effects)))
    assert message == f"two.toml [effects]: unknown effect 'zzzzzz'; allowed: {names}"


A_MASS = "allowed: a number from 1e-50 to 1e+50 kg, or 0 on a rod with mass"
AN_ANGLE = "allowed: a number from -1e+09 to 1e+09 rad"
A_RATE = "allowed: a number from -1e+09 to 1e+09 rad/s"
A_DURATION = "allowed: a number from 1e-50 to 1e+09 s"
GRAVITY = "allowed: a number from 0 to 1e+09 m/s^2"
ONE_EACH = "allowed: one entry for each link"

WRONG_TOP = [
    ("", ": missing key 'duration'"),
    ("title = 'x'", ": missing key 'duration'"),
    ("durration = 3", ": unknown key 'durration'; did you mean 'duration'? "),
    ("duration = 0", f": duration is 0; {A_DURATION}"),
    ("duration = -1.5", f": duration is -1.5; {A_DURATION}"),
    ("duration = inf", f": duration is inf; {A_DURATION}"),
    ("duration = nan", f": duration is nan; {A_DURATION}"),
    ("duration = 1e400", f": duration is inf; {A_DURATION}"),
    ("duration = '5'", f": duration is '5'; {A_DURATION}"),
    ("duration = true", f": duration is true; {A_DURATION}"),
    ("duration = 2020-01-01", f": duration is 2020-01-01; {A_DURATION}"),
    ("duration = [1]", f": duration is a list of 1; {A_DURATION}"),
    ("duration = 1\ntitle = 3", ": title is 3; allowed: text in quotes"),
    ("duration = 1\ntitle = ''", ": title is ''; allowed: one line of 1 to 200 characters"),
    ('duration = 1\ntitle = "a\\nb"', ": title is 'a\\\\nb'; allowed: one line of 1 to 200 characters"),
    ("duration = 1\ntitle = '" + 201 * "x" + "'", "'...; allowed: one line of 1 to 200 characters"),
    ("duration = 1\ngravity = 9.81", ": unknown key 'gravity'; allowed: chain, duration, effects, links, start, title"),
    ("duration = 0x" + 9999 * "f", f": duration is a whole number of about 12040 digits; {A_DURATION}"),
    ("duration = " + 9999 * "9", ": a whole number has too many digits"),
    ("duration = 1\nduration = 2", ": not TOML: Cannot overwrite a value (at line 2, column 13)"),
]

WRONG_CHAIN = [
    ("", ": missing table [chain]"),
    ("chain = 3", ": chain is 3; allowed: a table"),
    ("[[chain]]\nn = 2", ": chain is a list of 1; allowed: a table"),
    ("[chain]", " [chain]: missing 'masses', one for each link, or 'mass', one number for all"),
    ("[chain]\nmass = 1", " [chain]: missing 'lengths', one for each link, or 'length', one number for all"),
    ("[chain]\nmass = 1\nlength = 1", " [chain]: missing key 'n': how many links, where neither"),
    ("[chain]\nmass = 1\nmasses = [1]", " [chain]: both mass and masses are given; allowed: one of them"),
    (
        "[chain]\nmass = 1\nlength = 1\nlengths = [1]",
        " [chain]: both length and lengths are given; allowed: one of them",
    ),
    ("[chain]\nmases = [1]\nlength = 1", " [chain]: unknown key 'mases'; did you mean 'masses'? allowed: length, "),
    (
        "[chain]\nmasses = [1, 2]\nlengths = [1, 2, 3]",
        f" [chain]: masses has 2 entries but lengths has 3 entries; {ONE_EACH}",
    ),
    ("[chain]\nn = 3\nmasses = [1]\nlength = 1", f" [chain]: n is 3 but masses has 1 entry; {ONE_EACH}"),
    ("[chain]\nn = 1\nmasses = [1]\nlengths = [1, 2]", f" [chain]: n is 1 but lengths has 2 entries; {ONE_EACH}"),
    ("[chain]\nn = 0\nmass = 1\nlength = 1", " [chain]: n is 0; allowed: 1 or more"),
    ("[chain]\nn = -1\nmass = 1\nlength = 1", " [chain]: n is -1; allowed: 1 or more"),
    ("[chain]\nn = 1000001\nmass = 1\nlength = 1", " [chain]: n is 1000001; allowed: at most 1000000"),
    ("[chain]\nn = 0x" + 9999 * "f" + "\nmass = 1\nlength = 1", " digits; allowed: at most 1000000"),
    ("[chain]\nn = 2.0\nmass = 1\nlength = 1", " [chain]: n is 2.0; allowed: a whole number"),
    ("[chain]\nn = true\nmass = 1\nlength = 1", " [chain]: n is true; allowed: a whole number"),
    ("[chain]\nmasses = []\nlengths = [1]", " [chain]: masses is an empty list; allowed: 1 or more entries"),
    ("[chain]\nmasses = 1\nlengths = [1]", " [chain]: masses is 1; allowed: a list"),
    ("[chain]\nmass = [1]\nlengths = [1]", f" [chain]: mass is a list of 1; {A_MASS}"),
    ("[chain]\nmass = 0\nlengths = [1]", f" [chain]: mass is 0; {A_MASS}"),
    ("[chain]\nmass = {a = 1}\nlengths = [1]", f" [chain]: mass is a table; {A_MASS}"),
    ("[chain]\nmasses = [1, 0]\nlength = 1", f" [chain]: masses, entry 2, is 0; {A_MASS}"),
    ("[chain]\nmasses = [1, -1.0]\nlength = 1", f" [chain]: masses, entry 2, is -1.0; {A_MASS}"),
    ("[chain]\nmasses = [nan, 1]\nlength = 1", f" [chain]: masses, entry 1, is nan; {A_MASS}"),
    ("[chain]\nmasses = [1, -inf]\nlength = 1", f" [chain]: masses, entry 2, is -inf; {A_MASS}"),
    ("[chain]\nmasses = [1, 1e308]\nlength = 1", f" [chain]: masses, entry 2, is 1e+308; {A_MASS}"),
    ("[chain]\nmasses = [1, true]\nlength = 1", f" [chain]: masses, entry 2, is true; {A_MASS}"),
    ("[chain]\nmasses = [1, '1']\nlength = 1", f" [chain]: masses, entry 2, is '1'; {A_MASS}"),
    ("[chain]\nmasses = [1, [1]]\nlength = 1", f" [chain]: masses, entry 2, is a list of 1; {A_MASS}"),
    (
        "[chain]\nmass = 1\nlengths = [1, 0]",
        " [chain]: lengths, entry 2, is 0; allowed: a number from 1e-50 to 1e+50 m",
    ),
]

WRONG_START = [
    ("", ": missing table [start]"),
    ("[start]", " [start]: missing key 'angles'"),
    ("[start]\nangle = 1", " [start]: unknown key 'angle'; did you mean 'angles'? allowed: angles, rates"),
    ("[start]\nangles = [1]", f" [start]: angles has 1 entry but masses has 2 entries; {ONE_EACH}"),
    ("[start]\nangles = []", f" [start]: angles has 0 entries but masses has 2 entries; {ONE_EACH}"),
    ("[start]\nangles = 1\nrates = [1, 2, 3]", f" [start]: rates has 3 entries but masses has 2 entries; {ONE_EACH}"),
    ("[start]\nangles = 'down'", f" [start]: angles is 'down'; {AN_ANGLE}, or a list"),
    ("[start]\nangles = {}", f" [start]: angles is a table; {AN_ANGLE}, or a list"),
    ("[start]\nangles = 2e9", f" [start]: angles is 2000000000.0; {AN_ANGLE}, or a list"),
    ("[start]\nangles = [1, inf]", f" [start]: angles, entry 2, is inf; {AN_ANGLE}"),
    ("[start]\nangles = [1, '2']", f" [start]: angles, entry 2, is '2'; {AN_ANGLE}"),
    ("[start]\nangles = 1\nrates = true", f" [start]: rates is true; {A_RATE}, or a list"),
    ("[start]\nangles = 1\nrates = [1, false]", f" [start]: rates, entry 2, is false; {A_RATE}"),
]

WRONG_EFFECTS = [
    ("effects = 9.81", " [start]: unknown key 'effects'; allowed: angles, rates"),
    ("[effects]\ngravty = 1", " [effects]: unknown effect 'gravty'; did you mean 'gravity'? allowed: "),
    ("[effects]\ngravity = -9.81", f" [effects]: gravity is -9.81; {GRAVITY}"),
    ("[effects]\ngravity = inf", f" [effects]: gravity is inf; {GRAVITY}"),
    ("[effects]\ngravity = nan", f" [effects]: gravity is nan; {GRAVITY}"),
    ("[effects]\ngravity = '9.81'", f" [effects]: gravity is '9.81'; {GRAVITY}"),
    ("[effects]\ngravity = true", f" [effects]: gravity is true; {GRAVITY}"),
    ("[effects]\ngravity = [9.81]", f" [effects]: gravity is a list of 1; {GRAVITY}"),
    ("[effects.gravity]\nx = 1", f" [effects]: gravity is a table; {GRAVITY}"),
    ("[[effects]]\ngravity = 1", ": effects is a list of 1; allowed: a table"),
    ("[effects]\ngravity = " + 2000 * "[", ": lists or tables are nested too deeply"),
]

WRONG = [
    pytest.param(part, text, words, id=f"{part}-{i}")
    for part, cases in (("top", WRONG_TOP), ("chain", WRONG_CHAIN), ("start", WRONG_START), ("effects", WRONG_EFFECTS))
    for i, (text, words) in enumerate(cases)
]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("part", "text", "words"), WRONG)
def test_a_wrong_file_is_one_line(part: str, text: str, words: str) -> None:
    message = complaint(loaded, scene_text(**{part: text}))
    assert message.startswith("two.toml")
    assert words in message


ASKED = [
    ("top", f"{TOP}\ncart = {{mass = 1}}", ": cart: a cart or a free pivot cannot be simulated yet; allowed: a pivot"),
    (
        "effects",
        f"{EFFECTS}\nfriction = 0.1",
        " [effects]: friction: dry friction cannot be simulated yet; allowed: jo",
    ),
    ("start", "[start]\nangles = 1\nazimuths = 0", " [start]: azimuths: motion in three dimensions cannot be simulat"),
    ("chain", f"{CHAIN}\nboth_ends = true", " [chain]: both_ends: a chain held at both ends cannot be simulated yet"),
    ("chain", f"{CHAIN}\nparents = [0, 0]", " [chain]: parents: branches cannot be simulated yet; allowed: one chain"),
]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("part", "text", "words"), ASKED, ids=[words.split(": ")[1] for *_, words in ASKED])
def test_what_cannot_be_simulated_yet_is_said_so(part: str, text: str, words: str) -> None:
    assert complaint(loaded, scene_text(**{part: text})).startswith(f"two.toml{words}")


def test_what_cannot_be_simulated_yet_is_said_so_in_python_too() -> None:
    words = "scene 'two': friction: dry friction cannot be simulated yet; allowed: joint_damping and air_drag"
    assert complaint(scene, effects={"friction": 0.1}) == words


def test_no_key_that_there_is_is_said_not_to_be_there_yet() -> None:
    there = {"links", *CHAIN_KEYS, "title", "duration", "chain", "start", "effects", "angles", "rates", *names()}
    assert not there & NOT_YET.keys()


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("masses", "rods"), [("mass = 0", "0.3"), ("masses = [1, 0]", "[0, 0.3]"), ("mass = 1", "0")])
def test_a_mass_may_be_0_on_a_rod_with_mass(masses: str, rods: str) -> None:
    text = scene_text(chain=f"[chain]\nn = 2\n{masses}\nlength = 1", effects=f"[effects]\nrod_mass = {rods}")
    assert loaded(text).masses[1] == float(masses == "mass = 1")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("rods", ["[0.3, 0]", "[0.3, 1e-60]", "0"])
def test_a_mass_of_0_on_a_rod_without_is_one_line(rods: str) -> None:
    text = scene_text(chain="[chain]\nmasses = [0, 0]\nlength = 1", effects=f"[effects]\nrod_mass = {rods}")
    entry = 1 if rods == "0" else 2
    assert complaint(loaded, text) == f"two.toml [chain]: masses, entry {entry}, is 0; {A_MASS}"


@pytest.mark.usefixtures("here")
def test_a_study_is_no_scene() -> None:
    message = complaint(loaded, 'title = "A"\nscenes = ["arm.toml"]\n[[engines]]\nname = "pymunk"')
    assert message == "two.toml: this is a study, not a scene; to run it: pendbench study two.toml"


# --- names and paths -------------------------------------------------------------------------------------------------


def test_bundled_scenes_load_by_name_and_by_path() -> None:
    for name in bundled_names("models"):
        by_name, by_path = load_scene(name), load_scene(bundled("models") / f"{name}.toml")
        assert by_name.name == by_path.name == name
        assert by_name.digest == by_path.digest


def test_the_bundled_scenes_are_chains_of_one_metre_and_one_kilogram() -> None:
    links = {name: load_scene(name).n for name in bundled_names("models")}
    expected = {"single": 1, "double": 2, "double_calm": 2, "triple": 3, "chain5": 5, "chain10": 10, "chain50": 50}
    assert links.items() >= {**expected, "rope100": 100}.items()
    for name in (*expected, "rope100"):
        found = load_scene(name)
        # each of the n terms of a sum is rounded once, by half a unit in the last place at most
        assert math.isclose(found.total_length, 1.0, rel_tol=found.n * 2.0**-53)
        assert math.isclose(found.masses.sum(), 1.0, rel_tol=found.n * 2.0**-53)
        assert found.effects == Effects(gravity=9.81)
        assert found.duration == 10.0
        assert not found.rates.any()
        if name != "double_calm":
            assert (found.angles == math.pi / 2).all()
        assert (bundled("models") / f"{name}.toml").read_text().startswith("# ")


def test_a_rope_of_any_number_of_links_has_a_name() -> None:
    found, bundled_one = load_scene("rope250"), load_scene("rope200")
    assert (found.n, found.name, found.duration) == (250, "rope250", 2.0)
    assert found.effects == bundled_one.effects
    for name in ("masses", "lengths"):
        assert math.isclose(getattr(found, name).sum(), getattr(bundled_one, name).sum(), rel_tol=1e-13)
    assert (found.angles == bundled_one.angles[0]).all()
    assert load_scene("rope1000").duration == 1.0  # the bundled one


@pytest.mark.parametrize("name", ["rope0", "rope01", "rope1000001", "rope12.5", "rope", "rope-3", "Rope12", "rope1 "])
def test_what_is_no_rope_is_an_unknown_scene(name: str) -> None:
    assert "ropeN for any N" in complaint(load_scene, name)


def test_an_unknown_name_lists_the_bundled_ones() -> None:
    message = complaint(load_scene, "dubble")
    assert message.startswith("unknown scene 'dubble'; did you mean 'double'? allowed: a01, ")
    assert "rope100" in message


@pytest.mark.parametrize("name", ["", "..", "double ", "a\nb", "\x00", "x" * 9999])
def test_a_strange_name_is_an_unknown_one(name: str) -> None:
    assert "unknown scene" in complaint(load_scene, name)


@pytest.mark.parametrize("thing", [None, 3, ["double"]], ids=str)
def test_what_is_neither_a_name_nor_a_path(thing: Any) -> None:
    assert complaint(load_scene, thing).endswith(" is neither the name of a scene nor a path")


def test_a_path_may_be_relative_to_a_folder_or_to_the_working_folder(here: Path) -> None:
    folder = here / "studies"
    folder.mkdir()
    Path("two.toml").write_text(scene_text())
    assert load_scene("two.toml", relative_to=folder).duration == 5.0
    (folder / "two.toml").write_text(scene_text(top="duration = 7"))
    assert load_scene("two.toml", relative_to=folder).duration == 7.0
    assert load_scene("./two.toml").duration == 5.0
    assert load_scene(here / "two.toml", relative_to=folder).duration == 5.0
    assert load_scene("double", relative_to=folder).n == 2
    message = complaint(load_scene, "none.toml", relative_to=folder)
    assert message.startswith("none.toml: no such file, in ")
    assert message.endswith("studies or in the working folder")


@pytest.mark.usefixtures("here")
def test_a_file_without_its_ending_needs_a_separator_to_be_a_path() -> None:
    Path("double").write_text(scene_text())
    assert load_scene(f".{os.sep}double").title == "Two"
    assert load_scene("double").title != "Two"


@pytest.mark.usefixtures("here")
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in files here")
def test_a_pipe_is_no_scene() -> None:
    os.mkfifo("pipe.toml")
    assert complaint(load_scene, "pipe.toml") == "pipe.toml: not a regular file"


@pytest.mark.usefixtures("here")
def test_a_name_is_printable() -> None:
    Path("a\nb.toml").write_text(scene_text())
    assert load_scene("a\nb.toml").name == "a\\nb"


def test_importing_a_scene_does_not_load_pydantic() -> None:
    code = "import sys, pendbench.scene.scene; sys.exit('pydantic' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- from Python -----------------------------------------------------------------------------------------------------


def test_arrays_are_copied_and_read_only() -> None:
    mine = np.array([1.0, 2.5])
    made = scene(masses=mine)
    mine[0] = 9.0
    for other in (made, pickle.loads(pickle.dumps(made)), made.with_start([0, 1], [0, 0]), load_scene("double")):
        for array in (other.masses, other.lengths, other.angles, other.rates):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 3.0
    assert made.masses[0] == 1.0
    assert pickle.loads(pickle.dumps(made)).digest == made.digest


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"masses": [1.0]}, "masses has 1 entry but lengths has 2 entries"),
        ({"angles": [1.0]}, "masses has 2 entries but angles has 1 entry"),
        ({"rates": []}, "masses has 2 entries but rates has 0 entries"),
        ({"masses": []}, f"masses has 0 entries; allowed: 1 to {MAX_LINKS}"),
        ({"masses": np.ones(MAX_LINKS + 1)}, f"masses has {MAX_LINKS + 1} entries; allowed: 1 to {MAX_LINKS}"),
        ({"masses": 1.0}, "masses is not a list of numbers"),
        ({"masses": [[1.0, 2.0]]}, "masses is not a list of numbers"),
        ({"masses": [[1.0], [2.0, 3.0]]}, "masses is not a list of numbers"),
        ({"masses": ["1", "2"]}, "masses is not a list of numbers"),
        ({"masses": [True, True]}, "masses is not a list of numbers"),
        ({"masses": [1j, 2j]}, "masses is not a list of numbers"),
        ({"masses": [1, 10**400]}, "masses is not a list of numbers"),
        ({"masses": None}, "masses is not a list of numbers"),
        ({"masses": [1.0, 0.0]}, f"masses, entry 2, is 0; {A_MASS}"),
        ({"masses": [-1, 1]}, f"masses, entry 1, is -1; {A_MASS}"),
        ({"lengths": [1.0, math.nan]}, "lengths, entry 2, is nan; allowed: a number from 1e-50 to 1e+50 m"),
        ({"angles": [1.0, math.inf]}, f"angles, entry 2, is inf; {AN_ANGLE}"),
        ({"rates": [1.0, -2e9]}, f"rates, entry 2, is -2000000000.0; {A_RATE}"),
        ({"duration": 0}, f"duration is 0; {A_DURATION}"),
        ({"duration": "1"}, f"duration is '1'; {A_DURATION}"),
        ({"duration": True}, f"duration is true; {A_DURATION}"),
        ({"duration": 10**400}, f"duration is a whole number of about 401 digits; {A_DURATION}"),
        ({"title": None}, "title is None; allowed: str"),
        ({"name": 3}, "name is 3; allowed: str"),
        ({"effects": 9.81}, 'effects is 9.81; allowed: Effects, or their names with values, as in {"gravity": 9.81}'),
        ({"effects": {"gravty": 9.81}}, "effects: unknown effect 'gravty'; did you mean 'gravity'? allowed: "),
        ({"effects": {3: 9.81}}, "effects: unknown effect '3'; allowed: "),
        ({"effects": {"gravity": -1}}, "gravity is -1; allowed: "),
        ({"effects": np.zeros((9, 9))}, "; allowed: Effects"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_wrong_scene_is_one_line(changes: dict[str, Any], words: str) -> None:
    message = complaint(scene, **changes)
    assert words in message
    assert message.startswith("scene 3: " if "name" in changes else "scene 'two': ")


@pytest.mark.parametrize("gravity", [-1.0, math.nan, math.inf, "9.81", True, [9.81]], ids=str)
def test_a_wrong_effect_is_one_line(gravity: Any) -> None:
    assert complaint(Effects, gravity=gravity).endswith(GRAVITY)


def test_a_wrong_start_is_one_line() -> None:
    assert "angles has 1 entry" in complaint(scene().with_start, [1.0], [1.0, 2.0])


def test_the_digest_changes_with_what_decides_the_motion_and_with_nothing_else() -> None:
    same = [scene(), scene(name="other", title="Other"), scene(duration=np.float32(5)), scene(masses=(1, 2.5))]
    same.append(scene(effects=Effects(gravity=np.float64(9.81))))
    same.append(scene(effects={"gravity": 9.81, "air_drag": None}))
    assert {other.digest for other in same} == {scene().digest}
    others = [
        scene(masses=[1.0, math.nextafter(2.5, 3)]),
        scene(lengths=[1.0, 0.5]),
        scene(angles=[0.2, 0.1]),
        scene(rates=[0.0, 0.0]),
        scene(masses=[0.5, 1.0], lengths=[1.0, 2.5]),
        scene(duration=5.5),
        scene(effects=Effects()),
        scene(effects=Effects(gravity=0.0)),
        Scene("two", "Two", 5.0, [1.0], [0.5], [0.1], [1.0], Effects(gravity=9.81)),
    ]
    digests = {other.digest for other in others}
    assert len(digests) == len(others)
    assert scene().digest not in digests


def test_the_ranges_leave_room_for_the_arithmetic() -> None:
    """The products of the equations of motion, at the ends of the ranges, against the largest float."""
    total = MAX_LINKS * MASS.high
    centripetal = LENGTH.high * RATE.high**2
    tension = MAX_LINKS * total * centripetal
    with np.errstate(all="raise"):
        for product in (
            np.float64(total) * (LENGTH.high * MAX_LINKS) ** 2 * RATE.high**2,  # kinetic energy
            np.float64(tension) / MASS.low * MAX_LINKS / LENGTH.low,  # an angular acceleration
            np.float64(MASS.high) * total / MASS.low,  # the mass a rod feels
        ):
            assert np.isfinite(product)
    assert np.spacing(ANGLE.high) < 2e-7


# --- anything at all -------------------------------------------------------------------------------------------------

GOOD = scene_text()
CHAIN_KEYS = ["n", "mass", "masses", "length", "lengths"]
KEYS = st.sampled_from(
    [*CHAIN_KEYS, "title", "duration", "chain", "start", "effects", "angles", "rates", "gravity", "dampng", "new\nline"]
)
NUMBERS = st.one_of(
    st.integers(-3, 3),
    st.integers(-(10**30), 10**30),
    st.floats(),
    st.sampled_from([10**3000, 1e308, 5e-324, 1.0, 2.0]),
)
SIMPLE = st.one_of(NUMBERS, st.booleans(), st.text(max_size=8), st.lists(NUMBERS, max_size=3))
VALUES = st.recursive(
    SIMPLE,
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=4)),
    max_leaves=8,
)


def as_toml(value: Any) -> str:
    match value:
        case Mapping():
            return (
                "{"
                + ", ".join(f"{json.dumps(key, ensure_ascii=False)} = {as_toml(item)}" for key, item in value.items())
                + "}"
            )
        case list():
            return "[" + ", ".join(map(as_toml, value)) + "]"
        case str() | bool():
            return json.dumps(value, ensure_ascii=False)
        case _:
            return repr(value)


def check_scene_or_one_line(content: str | bytes) -> None:
    try:
        found = loaded(content)
    except InputError as error:
        message = str(error)
        assert message.startswith("two.toml")
        assert len(message) <= 800
        assert message.isprintable()
        return
    for field, allowed in (("masses", MASS), ("lengths", LENGTH), ("angles", ANGLE), ("rates", RATE)):
        array = getattr(found, field)
        assert array.shape == (found.n,)
        assert allowed.holds(array).all()


fuzz = settings(
    max_examples=150, deadline=None, database=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.mark.usefixtures("here")
@fuzz
@given(st.dictionaries(KEYS, VALUES, max_size=6))
def test_any_tables_are_a_scene_or_one_line(tables: dict[str, Any]) -> None:
    check_scene_or_one_line(
        "\n".join(f"{json.dumps(key, ensure_ascii=False)} = {as_toml(value)}" for key, value in tables.items())
    )


PLACES = ["title", "duration", "chain.n", "chain.mass", "chain.length", "chain.lengths", "start.angles", "start.rates"]


@pytest.mark.usefixtures("here")
@fuzz
@given(st.dictionaries(st.sampled_from([*PLACES, "effects.gravity", "effects.dampng"]), SIMPLE | VALUES, max_size=1))
def test_nearly_right_tables_are_a_scene_or_one_line(changes: dict[str, Any]) -> None:
    good = {"duration": 1, "chain.n": 2, "chain.mass": 1, "chain.length": 1, "start.angles": [0, 1]}
    check_scene_or_one_line("\n".join(f"{key} = {as_toml(value)}" for key, value in {**good, **changes}.items()))


SPLICES = st.text("0123456789.-+e[]{}=,#\"' \nabn", max_size=3).map(str.encode) | st.binary(max_size=2)


@pytest.mark.usefixtures("here")
@fuzz
@given(st.lists(st.tuples(st.integers(0, len(GOOD)), st.integers(0, 4), SPLICES), max_size=3))
def test_any_mutation_is_a_scene_or_one_line(changes: list[tuple[int, int, bytes]]) -> None:
    content = GOOD.encode()
    for place, dropped, inserted in changes:
        content = content[:place] + inserted + content[place + dropped :]
    check_scene_or_one_line(content)
