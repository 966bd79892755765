"""Keys: whatever decides a result is in its key, and nothing else is."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from pendbench.base import source
from pendbench.base.processes import processor
from pendbench.base.source import surroundings
from pendbench.engines import fingerprint as fingerprints
from pendbench.execution import content as contents
from pendbench.execution.content import content, key_of
from pendbench.execution.tasks import task
from pendbench.scene.scene import load_scene
from pendbench.study.case import Case
from pendbench.study.kinds import kind, kinds


@dataclass(frozen=True)
class Options:
    steps: int
    share: float
    names: tuple[str, ...] = ("a", "b")


@dataclass(frozen=True)
class Record:
    status: str
    reason: str = ""


CASE = Case(load_scene("double"), "mujoco", "rk4", 1e-3, (("default_flags", 1),))
TIMES = np.linspace(0.0, 1.0, 5)


def measure(case: Case, times: np.ndarray, options: Options, seed: int, *_: Record) -> Record:
    del case, times, options, seed
    return Record("ok")


def other(case: Case, times: np.ndarray, options: Options, seed: int) -> Record:
    return measure(case, times, options, seed)


def key(case=CASE, times=TIMES, options=Options(3, 0.5), seed=1, function=measure, needs=()) -> str:
    return task(function, case, times, options, seed, needs=needs).key


def test_the_same_ingredients_give_the_same_key():
    scene = load_scene("double")
    again = Case(scene, "mujoco", "rk4", 1e-3, (("default_flags", 1),))
    assert key(case=again, times=TIMES.copy(), options=Options(3, 0.5)) == key()


def test_what_decides_nothing_is_not_in_the_key():
    renamed = replace(CASE, scene=replace(CASE.scene, name="another", title="Another title"))
    assert key(case=renamed) == key()


@pytest.mark.parametrize(
    "changed",
    [
        {"function": other},
        {"seed": 2},
        {"seed": 1.0},
        {"seed": True},
        {"times": TIMES[:-1]},
        {"times": np.nextafter(TIMES, 2.0)},
        {"times": TIMES.astype(np.float32)},
        {"times": TIMES.reshape(5, 1)},
        {"times": tuple(TIMES.tolist())},
        {"options": Options(4, 0.5)},
        {"options": Options(3, np.nextafter(0.5, 1.0))},
        {"options": Options(3, 0.5, ("b", "a"))},
        {"case": replace(CASE, engine="analytic")},
        {"case": replace(CASE, method="euler")},
        {"case": replace(CASE, dt=2e-3)},
        {"case": replace(CASE, settings=())},
        {"case": replace(CASE, scene=load_scene("double_calm"))},
        {"case": replace(CASE, scene=replace(CASE.scene, duration=1.0))},
        {"case": replace(CASE, scene=CASE.scene.with_start(CASE.scene.angles + 1e-15, CASE.scene.rates))},
        {"needs": (task(other, CASE, TIMES, Options(1, 0.5), 1),)},
    ],
    ids=" ".join,
)
def test_each_ingredient_changes_the_key(changed):
    assert key(**changed) != key()


def test_a_key_changes_with_what_is_needed():
    def needing(seed):
        return key(needs=(task(other, CASE, TIMES, Options(1, 0.5), seed),))

    assert needing(1) == needing(1)
    assert needing(1) != needing(2)


def test_a_key_changes_with_the_project(monkeypatch):
    before = key()
    monkeypatch.setattr(contents, "source_digest", lambda: "another program")
    assert key() != before


@pytest.mark.parametrize("place", range(len(surroundings())))
def test_a_key_changes_with_the_libraries_and_the_machine(monkeypatch, place):
    """A kernel of another numba rounds otherwise, and a time is that of one processor."""
    before, there = key(), list(surroundings())
    there[place] = "another"
    monkeypatch.setattr(contents, "surroundings", lambda: tuple(there))
    assert key() != before


def test_the_surroundings_are_those_that_compute():
    named = " ".join(surroundings())
    assert all(name in named for name in ("numpy", "scipy", "numba", "llvmlite", processor()))


@pytest.mark.parametrize("name", kinds())
def test_a_function_whose_source_is_in_no_key_has_no_key(name):
    with pytest.raises(TypeError, match=f"kinds.{name}.study is in no key"):
        key_of(kind(name).measure)


def test_a_key_changes_with_the_engine_s_code(monkeypatch):
    before = key()
    monkeypatch.setattr("pendbench.study.case.fingerprint", lambda name: f"another {name}")
    assert key() != before


def test_a_mapping_is_told_by_its_entries_and_not_by_their_order():
    assert content({"a": 1, "b": 2}) == content({"b": 2, "a": 1}) != content({"a": 2, "b": 1})
    assert content({1, 2}) == content({2, 1}) != content({1, 3})


def test_joined_texts_are_not_taken_for_one_another():
    keys = {key_of(measure, *parts) for parts in [("a", "b"), ("ab",), (("a", "b"),), (["a", "b"],), (), (None,)]}
    assert len(keys) == 6


def test_what_has_no_content_has_no_key():
    with pytest.raises(TypeError, match="content of a object"):
        key_of(measure, object())


def test_addresses_are_no_content():
    with pytest.raises(TypeError, match="content of a ndarray"):
        content(np.array([object()]))


def library(folder: Path, body: str, name: str = "some_engine") -> None:
    (folder / name).mkdir(exist_ok=True)
    (folder / name / "__init__.py").write_text(body)


ENGINE = """
from pendbench.engines.protocol import Method
class Mine:
    name = "mine"
    methods = {"rk4": Method(order=4)}
    def version(self): return "1.0"
    def refuses(self, scene): return None
    def build(self, scene, method, dt): raise NotImplementedError
"""


def test_an_engine_that_is_worked_on_under_one_version_is_another_engine(tmp_path, monkeypatch):
    from pendbench.engines import registry

    monkeypatch.syspath_prepend(tmp_path)
    library(tmp_path, ENGINE)
    import some_engine

    monkeypatch.setitem(registry._registered, "mine", some_engine.Mine)
    other = type("Other", (some_engine.Mine,), {"__module__": "another_package", "libraries": ()})
    found = []
    for body in (ENGINE, ENGINE, ENGINE + "\n# gravity is off by 0.1 %\n"):
        library(tmp_path, body)
        fingerprints._of_libraries.cache_clear()
        found.append(fingerprints.fingerprint("mine"))
    assert found[0] == found[1] != found[2]
    monkeypatch.setitem(registry._registered, "mine", other)
    assert fingerprints.fingerprint("mine") not in found


def distribution(folder: Path, name: str, record: bytes) -> None:
    about = folder / f"{name}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Name: {name}\nVersion: 1.0\n")
    (about / "RECORD").write_bytes(record)


def parts(name: str) -> list[bytes]:
    return list(fingerprints._parts(name))


def test_a_library_that_was_installed_is_its_record_and_one_that_is_worked_on_its_files(tmp_path, monkeypatch):
    site, checkout, record = tmp_path / "site", tmp_path / "checkout", b"an_engine/__init__.py,sha256=abc,9\n"
    for folder in (site, checkout):
        folder.mkdir()
        library(folder, ENGINE, "an_engine")
    distribution(site, "an-engine", record)
    distribution(site, "an-engine-more", b"an_engine_more/__init__.py,sha256=def,9\nan_engine.more-1/x,,\n")
    distribution(site, "of-another-century", b"\xff\xfe,,\n")
    monkeypatch.syspath_prepend(site)
    assert parts("an_engine") == [record]
    monkeypatch.syspath_prepend(checkout)  # an import finds this one now, as it does one that is installed as editable
    assert parts("an_engine") == [b"__init__.py", ENGINE.encode()]


def test_a_library_in_two_places_is_known_by_records_where_both_have_one(tmp_path, monkeypatch):
    first, second = tmp_path / "first", tmp_path / "second"
    for folder in (first, second):
        (folder / "many_engines").mkdir(parents=True)
        (folder / f"many_engines/{folder.name}.py").write_text(folder.name)
        monkeypatch.syspath_prepend(folder)
    distribution(first, "many-first", b"many_engines/first.py,,\n")
    assert parts("many_engines") == [b"first.py", b"first", b"second.py", b"second"]
    distribution(second, "many-second", b"many_engines/second.py,,\n")
    assert parts("many_engines") == [b"many_engines/first.py,,\n", b"many_engines/second.py,,\n"]


def test_a_library_of_one_file_is_known_by_its_record(tmp_path, monkeypatch):
    (tmp_path / "one_engine.py").write_text("")
    distribution(tmp_path, "one-engine", b"one_engine.py,,\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert parts("one_engine") == [b"one_engine.py,,\n"]


@pytest.fixture
def forget():
    """Has the project's source looked at again, also when the test has ended."""

    def clear():
        source.source_digest.cache_clear()
        source._measuring.cache_clear()

    yield clear
    clear()


def test_pages_and_plots_are_no_part_of_the_source_of_results(tmp_path, monkeypatch, forget):
    for name in ("report/text.py", "kinds/one/page.py", "kinds/one/work.py", "commands/run.py", "physics/a.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    monkeypatch.setattr(source, "_PACKAGE", tmp_path)

    def digest():
        forget()
        return source.source_digest()

    before = digest()
    for name in ("report/text.py", "kinds/one/page.py", "kinds/one/page.md.j2", "commands/run.py"):
        (tmp_path / name).write_text("changed")
        assert digest() == before, name
    for name in ("kinds/one/work.py", "physics/a.py", "physics/new.py"):
        (tmp_path / name).write_text("changed")
        assert digest() != before, name
        before = digest()


def test_the_installed_packages_are_read_once_for_all_engines_until_something_is_installed(monkeypatch, tmp_path):
    read = []
    whole = fingerprints.metadata.distributions
    monkeypatch.setattr(fingerprints.metadata, "distributions", lambda: read.append(1) or whole())
    monkeypatch.syspath_prepend(tmp_path)
    for library in ("numpy", "scipy"):
        assert list(fingerprints._parts(library))
    assert len(read) == 1
    (tmp_path / "another").mkdir()
    os.utime(tmp_path, ns=(0, 1))  # as later as a clock can tell
    list(fingerprints._parts("numpy"))
    assert len(read) == 2
