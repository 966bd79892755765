"""Finished work on disk is there whole or not at all, and nothing else is taken for it."""

from __future__ import annotations

import json
import math
import os
import queue
import sys
import threading

import numpy as np
import pytest

from pendbench.files import alone_in, write_whole
from pendbench.source import source_digest
from pendbench.study import store as store_module
from pendbench.study.store import Store, key_of

KEY, OTHER = key_of("one"), key_of("another")
RECORD = {"error": 1.5e-9, "reason": "änderung\n", "list": [1, None, True], "none": None}
ARRAYS = {"t": np.linspace(0.0, 1.0, 7), "theta": np.arange(14.0).reshape(7, 2)}


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "work")


def files(store) -> set[str]:
    return {path.name for path in store.folder.iterdir()}


def test_what_was_saved_comes_back(store):
    store.save(KEY, RECORD)
    store.save_arrays(KEY, ARRAYS)
    assert store.load(KEY) == RECORD
    found = store.load_arrays(KEY)
    assert list(found) == list(ARRAYS)
    assert all(np.array_equal(found[name], ARRAYS[name]) for name in ARRAYS)
    assert files(store) == {f"{KEY}.json", f"{KEY}.npz"}


def test_what_was_not_saved_is_not_there(store):
    assert store.load(KEY) is None
    assert store.load_arrays(KEY) is None
    store.clear()  # not even the folder is there
    store.save(KEY, RECORD)
    assert store.load(OTHER) is None


def test_numbers_come_back_to_the_bit(store):
    numbers = [math.nan, math.inf, -math.inf, -0.0, 5e-324, 0.1 + 0.2, 1.7976931348623157e308]
    store.save(KEY, numbers)
    store.save_arrays(KEY, {"numbers": np.array(numbers)})
    bits = np.array(numbers).tobytes()
    assert np.array(store.load(KEY)).tobytes() == bits
    assert store.load_arrays(KEY)["numbers"].tobytes() == bits


def test_a_key_depends_on_all_its_parts_and_on_the_source(monkeypatch):
    keys = [key_of(), key_of("a", "b"), key_of("ab"), key_of(("a", "b")), key_of(1), key_of(1.0), key_of(0.1 + 0.2)]
    assert len({*keys, KEY, OTHER, key_of(0.3)}) == len(keys) + 3
    assert key_of("a", 0.1) == key_of("a", 0.1)
    assert len(source_digest()) == 16
    monkeypatch.setattr(store_module, "source_digest", lambda: "another program")
    assert key_of("one") != KEY


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
    assert store.load(KEY) is None
    store.save(KEY, RECORD)
    assert store.load(KEY) == RECORD


def test_a_record_that_was_cut_off_is_no_record(store):
    store.save(KEY, RECORD)
    path = store.folder / f"{KEY}.json"
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert store.load(KEY) is None, length


def test_a_record_with_a_bad_byte_is_no_record(store):
    store.save(KEY, RECORD)
    path = store.folder / f"{KEY}.json"
    whole = path.read_bytes()
    for place in range(len(whole)):
        for bit in (1, 2, 4):  # most digits become other digits
            path.write_bytes(whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1 :])
            assert store.load(KEY) in (None, RECORD), (place, bit)  # 1.5e-9 and 1.5E-9 are the same


def test_arrays_that_were_cut_off_are_none(store):
    store.save_arrays(KEY, ARRAYS)
    path = store.folder / f"{KEY}.npz"
    whole = path.read_bytes()
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        assert store.load_arrays(KEY) is None, length


def test_arrays_with_a_bad_byte_are_none_or_unharmed(store):
    store.save_arrays(KEY, ARRAYS)
    path = store.folder / f"{KEY}.npz"
    whole = path.read_bytes()
    for place in range(0, len(whole), 11):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        found = store.load_arrays(KEY)  # some bytes of a zip file, its dates among them, decide nothing
        assert found is None or all(np.array_equal(found.get(name), array) for name, array in ARRAYS.items()), place


def test_arrays_of_another_making_are_none(store):
    store.save_arrays(OTHER, ARRAYS)
    path = store.folder / f"{KEY}.npz"
    os.rename(store.folder / f"{OTHER}.npz", path)
    assert store.load_arrays(KEY) is None  # another key's
    np.savez(path, **ARRAYS)
    assert store.load_arrays(KEY) is None  # no key
    with open(path, "wb") as file:
        np.save(file, ARRAYS["t"])  # one array, and no archive
    assert store.load_arrays(KEY) is None
    np.savez(path, objects=np.array([{}, None], dtype=object))  # a pickle
    assert store.load_arrays(KEY) is None
    path.write_bytes(b"PK\x03\x04 text")
    assert store.load_arrays(KEY) is None
    path.unlink()
    path.mkdir()
    assert store.load_arrays(KEY) is None


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
    assert store.load(KEY) == before


def test_an_interrupted_write_leaves_no_file_behind(store):
    def interrupted(file):
        file.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(store.folder / f"{KEY}.json", interrupted)
    assert files(store) == set()


def test_a_value_that_json_does_not_know_leaves_nothing(store):
    with pytest.raises(TypeError):
        store.save(KEY, {"bad": object()})
    assert store.load(KEY) is None


def test_a_folder_is_for_one_at_a_time(tmp_path):
    """Threads stand for programs."""
    heard: queue.Queue[str] = queue.Queue()

    def second():
        with alone_in(tmp_path, lambda: heard.put("waits")):
            heard.put("has it")

    with alone_in(tmp_path, lambda: heard.put("waited for nobody")):
        other = threading.Thread(target=second)
        other.start()
        assert heard.get(timeout=60) == "waits"
        assert heard.empty()
    assert heard.get(timeout=60) == "has it"
    other.join(60)
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


def test_clearing_takes_only_what_is_the_stores(store):
    for key in (KEY, OTHER):
        store.save(key, RECORD)
        store.save_arrays(key, ARRAYS)
    foreign = {"notes.json", "data.npz", "cases.csv", f"{KEY}.txt", f"{KEY}0.json", f".{KEY}.json", "plots"}
    (store.folder / "plots").mkdir()
    for name in foreign - {"plots"}:
        (store.folder / name).write_text("mine")
    killed = f".{KEY}.json.x7_q2abc"  # what a write leaves that was killed
    (store.folder / killed).write_text("half")
    store.clear()
    assert files(store) == foreign
    assert store.load(KEY) is None
    assert store.load_arrays(OTHER) is None
