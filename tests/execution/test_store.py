"""Finished work on disk is there whole or not at all, and nothing else is taken for it."""

from __future__ import annotations

import json
import math
import queue
import sys
import threading
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pytest

from pendbench.base.arrays import FloatArray
from pendbench.base.files import alone_in, write_whole
from pendbench.execution.store import Store

KEY, OTHER = "a" * 24, "b" * 24


class Crossing(NamedTuple):
    time: float
    low: float | None


@dataclass(frozen=True)
class Record:
    status: str
    reason: str = ""
    error: float = 0.0
    crossings: tuple[Crossing | None, ...] = ()
    by_name: dict[str, Crossing] | None = None
    chaotic: bool = False
    steps: int | None = None


@dataclass(frozen=True, eq=False)
class Arrays:
    t: FloatArray
    theta: FloatArray


RECORD = Record("ok", "änderung\n", 1.5e-9, (Crossing(1.0, None), None), {"x": Crossing(0.1, 2.0)}, True, 7)


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "work")


def files(store) -> set[str]:
    return {path.name for path in store.folder.iterdir()}


def test_what_was_saved_comes_back(store):
    store.save(KEY, RECORD)
    found = store.load(KEY, Record)
    assert found == RECORD
    assert type(found.crossings[0]) is Crossing
    assert files(store) == {f"{KEY}.json"}


def test_what_was_not_saved_is_not_there(store):
    assert store.load(KEY, Record) is None
    store.clear()  # not even the folder is there
    store.save(KEY, RECORD)
    assert store.load(OTHER, Record) is None


@pytest.mark.parametrize("wanted", [Crossing, Arrays, int])
def test_a_record_of_another_type_is_not_there(store, wanted):
    store.save(KEY, RECORD)
    assert store.load(KEY, wanted) is None


def test_numbers_come_back_to_the_bit(store):
    numbers = np.array([math.nan, math.inf, -math.inf, -0.0, 5e-324, 0.1 + 0.2, 1.7976931348623157e308])
    store.save(KEY, Arrays(numbers, numbers.reshape(7, 1)))
    found = store.load(KEY, Arrays)
    assert found.t.tobytes() == found.theta.tobytes() == numbers.tobytes()
    assert found.theta.shape == (7, 1)
    for number in numbers.tolist():
        store.save(OTHER, replace(RECORD, error=number))
        assert np.float64(store.load(OTHER, Record).error).tobytes() == np.float64(number).tobytes()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"null",
        b"[1, 2]",
        b"5",
        b'"text"',
        b"{}",
        json.dumps({"key": OTHER, "value": 1}).encode(),
        json.dumps({"value": 1}).encode(),
        json.dumps({"key": KEY}).encode(),
        json.dumps({"key": [KEY], "value": 1}).encode(),
        b"[" * 100_000,
    ],
)
def test_a_file_of_another_making_is_no_record(store, content):
    store.save(KEY, RECORD)
    (store.folder / f"{KEY}.json").write_bytes(content)
    assert store.load(KEY, Record) is None
    store.save(KEY, RECORD)
    assert store.load(KEY, Record) == RECORD


def test_the_file_of_another_key_is_no_record(store):
    store.save(OTHER, RECORD)
    (store.folder / f"{OTHER}.json").rename(store.folder / f"{KEY}.json")
    assert store.load(KEY, Record) is None


def test_a_record_that_was_cut_off_is_no_record(store):
    store.save(KEY, RECORD)
    path = store.folder / f"{KEY}.json"
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert store.load(KEY, Record) is None, length


def test_a_record_with_a_bad_byte_is_no_record(store):
    store.save(KEY, RECORD)
    path = store.folder / f"{KEY}.json"
    whole = path.read_bytes()
    for place in range(len(whole)):
        for bit in (1, 2, 4):  # most digits become other digits
            path.write_bytes(whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1 :])
            assert store.load(KEY, Record) in (None, RECORD), (place, bit)  # 1.5e-9 and 1.5E-9 are the same


def test_arrays_with_a_bad_byte_are_no_record(store):
    kept = Arrays(np.linspace(0.0, 1.0, 7), np.arange(14.0).reshape(7, 2))
    store.save(KEY, kept)
    path = store.folder / f"{KEY}.json"
    whole = path.read_bytes()
    for place in range(0, len(whole), 3):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        found = store.load(KEY, Arrays)
        assert found is None or np.array_equal(found.theta, kept.theta), place


@pytest.mark.parametrize("before", [None, RECORD])
def test_a_write_that_fails_leaves_what_was_there(store, before):
    if before is not None:
        store.save(KEY, before)
    store.folder.mkdir(exist_ok=True)
    path = store.folder / f"{KEY}.json"
    there = files(store)

    def fails(file):
        file.write(b'{"key": ')
        file.flush()
        assert files(store) > there  # beside the file, not in it
        raise OSError("no space left on device")

    with pytest.raises(OSError, match="no space"):
        write_whole(path, fails)
    assert files(store) == there
    assert store.load(KEY, Record) == before


def test_an_interrupted_write_leaves_no_file_behind(store):
    def interrupted(file):
        file.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(store.folder / f"{KEY}.json", interrupted)
    assert files(store) == set()


def test_a_value_that_json_does_not_know_leaves_nothing(store):
    with pytest.raises(TypeError):
        store.save(KEY, replace(RECORD, error=object()))
    assert store.load(KEY, Record) is None


def test_a_folder_is_for_one_at_a_time(tmp_path):
    """Threads stand for programs."""
    heard: queue.Queue[str] = queue.Queue()

    def second():
        with alone_in(tmp_path, lambda: heard.put("waits")):
            heard.put("has it")

    with alone_in(tmp_path, lambda: heard.put("waited for nobody")):
        other = threading.Thread(target=second)
        other.start()
        assert heard.get(timeout=600) == "waits"
        assert heard.empty()
    assert heard.get(timeout=600) == "has it"
    other.join(600)
    with pytest.raises(KeyboardInterrupt), alone_in(tmp_path, heard.put):
        raise KeyboardInterrupt
    with alone_in(tmp_path, lambda: heard.put("waited for nobody")):
        assert heard.empty()


def test_where_there_are_no_locks_nobody_waits(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr("fcntl.flock", none)
    with alone_in(tmp_path, pytest.fail), alone_in(tmp_path, pytest.fail):
        pass
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with alone_in(tmp_path, pytest.fail), alone_in(tmp_path, pytest.fail):
        pass


def test_results_are_counted_whoever_made_them(store):
    assert store.count() == 0  # not even the folder is there
    store.save(KEY, RECORD)
    (store.folder / f"{OTHER}.npz").write_bytes(b"of an earlier version")
    (store.folder / f".{KEY}.json.x7_q2abc").write_text("half")
    (store.folder / "notes.json").write_text("mine")
    assert store.count() == 2


def test_clearing_takes_only_what_is_the_stores(store):
    for key in (KEY, OTHER):
        store.save(key, RECORD)
    foreign = {"notes.json", "data.npz", "cases.csv", f"{KEY}.txt", f"{KEY}0.json", f".{KEY}.json", "plots"}
    (store.folder / "plots").mkdir()
    for name in foreign - {"plots"}:
        (store.folder / name).write_text("mine")
    killed = f".{KEY}.json.x7_q2abc"  # what a write leaves that was killed
    (store.folder / killed).write_text("half")
    store.clear()
    assert files(store) == foreign
    assert store.load(KEY, Record) is None
