"""Every scene and study that comes with the program, damaged in many ways: it is read as it is written, or refused."""

from __future__ import annotations

import csv
import dataclasses
import os
import random
import re
import time
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from markdown_it import MarkdownIt

from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError
from pendbench.base.strict import MAX_LINES
from pendbench.engines.mujoco.mjcf import write_mjcf
from pendbench.scene.scene import Scene, load_scene
from pendbench.study.plan import Plan, load_plan
from support.tiny_study import Inline, run
from support.writing import toml

SCENES, STUDIES = bundled_names("models"), bundled_names("studies")
#: How often each scene and each study is damaged, and how long reading one may take, s.
TRIES, STUDY_TRIES, LONGEST = 60, 60, 20.0

ODD = [
    b"nan",
    b"-inf",
    b"1e999",
    b"0",
    b"-1",
    b"1_0",
    b"0x" + b"f" * 400,
    b"9" * 5000,
    b"1e-320",
    b"true",
    b"''",
    b"[]",
]
ODD += [
    b"{}",
    b"[[1]]",
    b'"""',
    b"\xff",
    b"\x00",
    b"\xef\xbb\xbf",
    b"\r",
    b"\n",
    b"#",
    b"[effects]",
    b"gravity = 1\n",
    b"=",
]
ODD += ["é\u2028\ud7ff".encode(), b"a.b.c = 1\n", b"[" * 3000, b"1979-05-27T07:32:00Z", b"1e6", b"1000000"]


def text_of(kind: str, name: str) -> bytes:
    return (bundled(kind) / f"{name}.toml").read_bytes()


# --- damage ----------------------------------------------------------------------------------------------------------


def _flip(content: bytes, at: int, chance: random.Random) -> bytes:
    return content[:at] + bytes([content[at] ^ 1 << chance.randrange(8)]) + content[at + 1 :]


def _put(content: bytes, at: int, chance: random.Random) -> bytes:
    return content[:at] + chance.choice(ODD) + content[at:]


def _cut(content: bytes, at: int, chance: random.Random) -> bytes:
    return content[:at] + content[at + chance.randint(1, 20) :]


def _end(content: bytes, at: int, chance: random.Random) -> bytes:  # noqa: ARG001
    return content[:at]


def _repeat(content: bytes, at: int, chance: random.Random) -> bytes:
    return content[:at] + content[at : at + chance.randint(1, 60)] * 2 + content[at:]


def _move_line(content: bytes, at: int, chance: random.Random) -> bytes:
    lines = content.splitlines(keepends=True)
    line = lines.pop(at % len(lines))
    lines.insert(chance.randint(0, len(lines)), line)
    return b"".join(lines)


def _odd_number(content: bytes, at: int, chance: random.Random) -> bytes:
    found = [*re.finditer(rb"-?\d[\d.e+-]*", content)]
    number = found[at % len(found)]
    return content[: number.start()] + chance.choice(ODD) + content[number.end() :]


def _digit(content: bytes, at: int, chance: random.Random) -> bytes:
    places = [place for place, byte in enumerate(content) if chr(byte).isdigit()]
    place = places[at % len(places)]
    return content[:place] + str(chance.randrange(10)).encode() + content[place + 1 :]


DAMAGES: list[Callable[[bytes, int, random.Random], bytes]] = [
    _flip, _put, _cut, _end, _repeat, _move_line, _odd_number, _digit
]  # fmt: skip


def damaged(content: bytes, chance: random.Random) -> bytes:
    """The content after one to three damages."""
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        if any(byte in b"0123456789" for byte in content):
            content = chance.choice(DAMAGES)(content, chance.randrange(len(content)), chance)
    return content


ODD_VALUES = [None, True, 0, -1, 1, 2.5, 10**400, float("nan"), float("inf"), "", "x\ny", "double", "rk4", [], [[]], {}]
ODD_VALUES += [[1.0, "x"], {"a": {"b": [1]}}, [{}], 1e-3, [1e-3], ["double"], {"starts": 0}]


def restructured(table: Any, chance: random.Random) -> Any:
    """The tables and lists of a file with one value somewhere in them replaced, left out, added or put in a list."""
    if not isinstance(table, (dict, list)) or not table or chance.random() < 0.2:
        return chance.choice([*ODD_VALUES, [table], {"x": table}])
    changed = dict(table) if isinstance(table, dict) else dict(enumerate(table))
    key = chance.choice([*changed])
    match chance.randrange(6):
        case 0:
            del changed[key]
        case 1:
            new = chance.choice(["n", "gravity", "dt", "name", "quick", "seed", "é\n", "mass"])
            changed[new if isinstance(table, dict) else len(table)] = chance.choice(ODD_VALUES)
        case _:
            changed[key] = restructured(changed[key], chance)
    return changed if isinstance(table, dict) else [*changed.values()]


def as_text(tables: Any) -> bytes:
    lines = [f"{toml(key)} = {toml(value)}" for key, value in tables.items()] if isinstance(tables, dict) else []
    return "\n".join(lines).encode()


# --- what may come of it ---------------------------------------------------------------------------------------------


def read(load: Callable[[], Any], path: Path) -> Any:
    """What is loaded, or None where it is refused, soon and in one line that names the file."""
    began = time.process_time()
    try:
        found = load()
    except InputError as error:
        message = str(error)
        assert message.startswith(str(path)[-40:]) or str(path)[-40:] in message
        assert len(message) <= MAX_LINES
        assert message.isprintable()
        found = None
    assert time.process_time() - began < LONGEST
    return found


def assert_as_written(scene: Scene, written: dict[str, Any]) -> None:
    """The scene is all of what the file says, and nothing else."""
    chain, start = written["chain"], written["start"]
    assert set(written) <= {"title", "duration", "chain", "start", "effects"}
    assert set(chain) <= {"n", "mass", "masses", "length", "lengths"}
    assert set(start) <= {"angles", "rates"}
    assert scene.n == chain.get("n", scene.n)
    assert scene.duration == written["duration"]
    assert scene.title == written.get("title", scene.name)
    for values, found in (
        (chain.get("masses", chain.get("mass")), scene.masses),
        (chain.get("lengths", chain.get("length")), scene.lengths),
        (start["angles"], scene.angles),
        (start.get("rates", 0.0), scene.rates),
    ):
        assert np.array_equal(found, np.broadcast_to(np.array(values, float), (scene.n,)))
    asked = written.get("effects", {})
    assert set(scene.effects.named()) == set(asked)
    for name, value in asked.items():
        assert as_in_a_file(getattr(scene.effects, name), value) == value
    assert dataclasses.replace(scene).digest == scene.digest  # checked again, from Python


def as_in_a_file(value: Any, written: Any) -> Any:
    """An effect's value as TOML holds it, without the numbers that the file leaves out, which must be 0."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {key: number for key, number in dataclasses.asdict(value).items() if key in written or number != 0.0}
    return list(value) if isinstance(value, tuple) else value


def assert_as_asked(plan: Plan, written: dict[str, Any]) -> None:
    """The plan is all of what the file says, and nothing is run that it does not say."""
    options = plan.options.model_dump()
    for key, value in written.items():
        if key not in {"engines", "quick"}:
            assert options[key] == value or [*options[key]] == value, key
    tables = written.get(
        "engines", [{"name": table["name"]} for table in options["engines"]]
    )  # all, where none is named
    for table, found in zip(tables, options["engines"], strict=True):
        assert {key: found[key] for key in table} == table
    assert [scene.name for scene in plan.scenes] == [Path(name).stem for name in written["scenes"]]
    asked = {(table["name"], method) for table in tables for method in table.get("methods", ())}
    whole = {table["name"] for table in tables if "methods" not in table}
    assert {(case.engine, case.method) for case in plan.cases if case.engine not in whole} <= asked
    assert plan.cases


@pytest.mark.parametrize("name", SCENES)
def test_a_damaged_scene_is_read_as_it_is_written_or_refused(name, tmp_path):
    chance, content = random.Random(name), text_of("models", name)
    path = tmp_path / "scene.toml"
    changed = [damaged(content, chance) for _ in range(TRIES)]
    changed += [as_text(restructured(tomllib.loads(content.decode()), chance)) for _ in range(TRIES)]
    outcomes = set()
    for text in changed:
        path.write_bytes(text)
        scene = read(lambda: load_scene(path), path)
        if scene is not None:
            assert_as_written(scene, tomllib.loads(text.decode("utf-8-sig")))
        outcomes.add(scene is None)
    assert outcomes == {True, False}, "all were refused, or none"


@pytest.mark.parametrize("name", STUDIES)
def test_a_damaged_study_is_read_as_it_is_written_or_refused(name, tmp_path):
    chance, content = random.Random(name), text_of("studies", name)
    path = tmp_path / "study.toml"
    changed = [damaged(content, chance) for _ in range(STUDY_TRIES)]
    changed += [as_text(restructured(tomllib.loads(content.decode()), chance)) for _ in range(STUDY_TRIES)]
    outcomes = set()
    for text in changed:
        path.write_bytes(text)
        for quick in (False, True):
            plan = read(lambda quick=quick: load_plan(path, quick=quick), path)
            if plan is not None:
                written = tomllib.loads(text.decode("utf-8-sig"))
                assert_as_asked(plan, {**written, **written.get("quick", {})} if quick else written)
            outcomes.add(plan is None)
    assert outcomes == {True, False}, "all were refused, or none"


# --- text from files, on its way to where it is read -----------------------------------------------------------------

EVIL = "=cmd()|'`x` <b>\"&*[a](http:b.c) $y$ _z_"
STUDY = """
title         = '''{title}'''
scenes        = ['''{scene}''']
starts        = 0
sample        = 0.1
lyapunov_time = 5.0

[[engines]]
name    = "analytic"
methods = ["adaptive", "rk4"]
dt      = [1e-2]
"""
SCENE = """
title    = '''{title}'''
duration = 1.0
chain    = {{ masses = [1, 1], length = 1 }}
start    = {{ angles = 1 }}
effects  = {{ gravity = 9.81 }}
"""


@pytest.mark.skipif(os.name != "posix", reason="no such names of files here")
def test_text_from_files_does_nothing_where_it_is_shown(tmp_path):
    scene, study = tmp_path / f"{EVIL}.toml", tmp_path / f"@{EVIL}.toml"
    scene.write_text(SCENE.format(title=EVIL))
    study.write_text(STUDY.format(title=f"+{EVIL}", scene=scene.name))
    out = tmp_path / "out"
    found = run(study, out, Inline, report=True).report
    assert {row.case.scene.name for row in found.cases} == {EVIL}

    for path in out.glob("*.csv"):
        with open(path, encoding="utf-8", newline="") as file:
            for cell in (cell for row in csv.reader(file) for cell in row):
                assert cell[:1] not in {"=", "+", "@", "|", "\t"}, path.name
                assert "\n" not in cell
    with open(out / "cases.csv", encoding="utf-8", newline="") as file:
        assert {row["scene"] for row in csv.DictReader(file)} == {f"'{EVIL}"}

    page = (out / "report.md").read_text(encoding="utf-8")
    tokens = MarkdownIt("commonmark").enable("table").parse(page)
    inside = [child for token in tokens for child in token.children or ()]
    assert not {token.type for token in tokens + inside} & {"html_block", "html_inline"}
    for token in inside:
        target = token.attrs.get("href") or token.attrs.get("src")
        assert target is None or (out / str(target)).is_file()
    shown = ["".join(child.content for child in token.children or ()) for token in tokens if token.type == "inline"]
    assert f"+{EVIL}" in shown, "the title is not shown as it is written"
    assert EVIL in shown, "the scene's name is not shown as it is written"

    model = ET.fromstring(write_mjcf(load_scene(scene)))
    assert model.get("model") == EVIL
    assert model.find("custom/text").get("data") == EVIL
