"""A file that cannot be used is an `InputError` of one line that names the file and the place in it."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from pendbench.base import strict
from pendbench.base.errors import InputError


def written(folder: Path, content: bytes, name: str = "file.toml") -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def complaint(path: Path | str) -> str:
    with pytest.raises(InputError) as caught:
        strict.read_toml(path)
    message = str(caught.value)
    assert len(message) <= strict.MAX_LINE
    assert message.isprintable()
    return message


# --- reading ---------------------------------------------------------------------------------------------------------


def test_a_good_file_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, b"title = 'caf\xc3\xa9'\r\n[chain]\nn = 3\n")
    assert strict.read_toml(path) == {"title": "café", "chain": {"n": 3}}


def test_a_mark_of_the_encoding_is_no_part_of_the_text(tmp_path: Path) -> None:
    assert strict.read_toml(written(tmp_path, b"\xef\xbb\xbfn = 1\n")) == {"n": 1}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"n = 1\nm = \xff\n", "not UTF-8: byte 0xff (at line 2)"),
        ("n = 1\n".encode("utf-16"), "not UTF-8: byte 0xff (at line 1)"),
        (b"n = 1\nm = \n", "not TOML: Invalid value (at line 2, column 5)"),
        (b"n = 1\nn = 2", "not TOML: Cannot overwrite a value (at the end, line 2)"),
        (b"n = " + b"[" * 5000, "nested too deeply"),
        (b"n = " + b"{a=" * 5000, "nested too deeply"),
        (b"n = " + b"9" * 5000, "too many digits"),
        (b"n = 1\n" + b"a." * 50 + b"a = 1", "a dotted key of more than 32 parts (at line 2)"),
        (b"n = 1\n[" + b"'a' . " * 50 + b"a]", "a dotted key of more than 32 parts (at line 2)"),
        (b"#" * (strict.MAX_BYTES + 1), "larger than 1048576 bytes"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_content_that_cannot_be_read(tmp_path: Path, content: bytes, words: str) -> None:
    message = complaint(written(tmp_path, content))
    assert "file.toml: " in message
    assert words in message


def test_the_largest_file_and_the_longest_key_that_are_read(tmp_path: Path) -> None:
    text = ".".join("a" * strict.MAX_KEY_PARTS) + " = 1\n# "
    content = text.encode() + b"x" * (strict.MAX_BYTES - len(text))
    assert list(strict.read_toml(written(tmp_path, content))) == ["a"]


def test_missing_files_and_folders(tmp_path: Path) -> None:
    assert complaint(tmp_path / "none.toml").endswith("none.toml: no such file")
    assert complaint(tmp_path).endswith("a folder, not a file")
    assert complaint(written(tmp_path, b"") / "below.toml").endswith("cannot be read: Not a directory")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="everything can be read")
def test_a_file_without_permission(tmp_path: Path) -> None:
    path = written(tmp_path, b"n = 1")
    path.chmod(0)
    assert complaint(path).endswith("cannot be read: Permission denied")


@pytest.fixture
def opens_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("opened")

    monkeypatch.setattr(strict, "open", refuse, raising=False)


@pytest.mark.usefixtures("opens_nothing")
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in files here")
def test_a_pipe_and_a_device_are_not_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    assert complaint(tmp_path / "pipe.toml").endswith("not a regular file")
    (tmp_path / "link.toml").symlink_to("/dev/zero")
    assert complaint(tmp_path / "link.toml").endswith("not a regular file")


@pytest.mark.usefixtures("opens_nothing")
def test_a_large_file_is_not_opened(tmp_path: Path) -> None:
    path = written(tmp_path, b"")
    os.truncate(path, 10**9)
    assert "larger than" in complaint(path)


@pytest.mark.parametrize(
    "name", ["a\nb.toml", "\x1b[31m.toml", "a\x00b.toml", "\ud800.toml", "x" * 5000, "\n" * 200], ids=ascii
)
def test_a_name_cannot_break_the_line(tmp_path: Path, name: str) -> None:
    message = complaint(str(tmp_path / name))
    assert message.rsplit(": ", 1)[1]  # what is wrong is still there, after the name


@given(st.text())
def test_whatever_is_shown_is_short_and_on_one_line(text: str) -> None:
    for shown in (strict.show(text * 10), strict.shown_path(text * 100)):
        assert shown.isprintable()
        assert len(shown) <= 130


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (True, "true"),
        (-3, "-3"),
        (float("nan"), "nan"),
        ("1", "'1'"),
        ({"a": 1}, "a table"),
        ([1, 2], "a list of 2"),
        ([], "an empty list"),
        (None, "None"),
    ],
)
def test_how_values_are_shown(value: object, shown: str) -> None:
    assert strict.show(value) == shown


def test_how_a_number_is_shown_that_python_will_not_print() -> None:
    assert strict.show(10**5000) == "a whole number of about 5001 digits"


def test_a_message_is_bounded_and_on_one_line() -> None:
    message = str(strict.input_error("file.toml", "\n" * 999))
    assert len(message) == strict.MAX_LINE
    assert message.isprintable()


# --- validating ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sauce:
    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}
    KEYS_ARE: ClassVar[str] = "ingredient"

    pepper: float | None = None
    tomato: float | None = None


class Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class Course(Table):
    name: str
    kind: Literal["cold", "hot"] = "hot"
    hours: Annotated[float, Field(gt=0, lt=9)] = 1.0
    guests: Annotated[int, Field(ge=1)] | list[int] = 1

    @field_validator("name")
    @classmethod
    def _a_word(cls, name: str) -> str:
        if " " in name:
            raise ValueError("one word")
        return name

    @model_validator(mode="after")
    def _no_cold_soup(self) -> Course:
        if self.name == "soup" and self.kind == "cold":
            raise InputError("soup is not cold")
        return self


class Buffet(Table):
    dish: Course


class Menu(Table):
    vegan: bool = False
    courses: Annotated[list[Course], Field(min_length=1, max_length=2)]
    sauce: Sauce = Sauce()
    plain: Course | None = None
    buffet: Buffet | None = None
    tables: dict[str, Course] = {}


SOUP: dict[str, Any] = {"name": "soup"}


def explanation(data: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        strict.validate(Menu, data, "menu.toml")
    message = str(caught.value)
    assert len(message) <= (strict.MAX_LINES if " faults: " in message else strict.MAX_LINE)
    assert message.isprintable()
    return message


def test_good_data_is_returned_as_the_model() -> None:
    menu = strict.validate(Menu, {"courses": [{**SOUP, "hours": 2, "guests": [1, 2]}], "sauce": {"pepper": 1}}, "")
    assert menu.courses[0].hours == 2.0
    assert menu.sauce == Sauce(pepper=1.0)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "menu.toml: missing table [[courses]]"),
        ({"courses": [SOUP], "buffet": {}}, "menu.toml [buffet]: missing table [dish]"),
        ({"plain": {}, "courses": [SOUP]}, "menu.toml [plain]: missing key 'name'"),
        (
            {"course": [SOUP]},
            "menu.toml: unknown key 'course'; did you mean 'courses'? "
            "allowed: buffet, courses, plain, sauce, tables, vegan",
        ),
        (
            {"courses": [SOUP], "sauce": {"peper": 1}},
            "menu.toml [sauce]: unknown ingredient 'peper'; did you mean 'pepper'? allowed: pepper, tomato",
        ),
        (
            {"courses": [SOUP, {**SOUP, "hour": 1}]},
            "menu.toml [courses number 2]: unknown key 'hour'; did you mean 'hours'? "
            "allowed: guests, hours, kind, name",
        ),
        (
            {"courses": [SOUP], "tables": {"garden": {**SOUP, "zzzz": 1}}},
            "menu.toml [tables.garden]: unknown key 'zzzz'; allowed: guests, hours, kind, name",
        ),
        ({"courses": SOUP}, "menu.toml: courses is a table; allowed: a list"),
        ({"courses": []}, "menu.toml: courses is an empty list; allowed: 1 or more entries"),
        ({"courses": [SOUP] * 3}, "menu.toml: courses is a list of 3; allowed: at most 2 entries"),
        ({"courses": [3]}, "menu.toml: courses, entry 1, is 3; allowed: a table"),
        ({"courses": [SOUP], "sauce": 3}, "menu.toml: sauce is 3; allowed: a table"),
        ({"courses": [SOUP], "plain": 3}, "menu.toml: plain is 3; allowed: a table"),
        ({"courses": [SOUP], "vegan": "no"}, "menu.toml: vegan is 'no'; allowed: true or false"),
        ({"courses": [{"name": 3}]}, "menu.toml [courses number 1]: name is 3; allowed: text in quotes"),
        ({"courses": [{"name": "a b"}]}, "menu.toml [courses number 1]: name is 'a b'; allowed: one word"),
        ({"courses": [{**SOUP, "kind": "cold"}]}, "menu.toml [courses number 1]: soup is not cold"),
        (
            {"courses": [{**SOUP, "kind": "cald"}]},
            "menu.toml [courses number 1]: unknown kind 'cald'; did you mean 'cold'? allowed: cold, hot",
        ),
        (
            {"courses": [{**SOUP, "kind": 1}]},
            "menu.toml [courses number 1]: kind is 1; allowed: 'cold' or 'hot'",
        ),
        (
            {"courses": [{**SOUP, "hours": "1"}]},
            "menu.toml [courses number 1]: hours is '1'; allowed: a number",
        ),
        (
            {"courses": [{**SOUP, "hours": True}]},
            "menu.toml [courses number 1]: hours is true; allowed: a number",
        ),
        ({"courses": [{**SOUP, "hours": 0}]}, "menu.toml [courses number 1]: hours is 0; allowed: above 0.0"),
        (
            {"courses": [{**SOUP, "hours": 9.5}]},
            "menu.toml [courses number 1]: hours is 9.5; allowed: below 9.0",
        ),
        (
            {"courses": [{**SOUP, "guests": "many"}]},
            "menu.toml [courses number 1]: guests is 'many'; allowed: a whole number, or a list",
        ),
        (
            {"courses": [{**SOUP, "guests": [1, 2.5]}]},
            "menu.toml [courses number 1]: guests, entry 2, is 2.5; allowed: a whole number",
        ),
        (
            {"courses": [{**SOUP, "guests": 0}]},
            "menu.toml [courses number 1]: guests is 0; allowed: 1 or more, or a list",
        ),
    ],
)
def test_one_fault_in_words(data: dict[str, Any], message: str) -> None:
    assert explanation(data) == message


def test_all_faults_are_told_and_unknown_keys_come_first() -> None:
    data = {"vegan": 1, "courses": [{"name": "a b", "hours": 0}, {"kind": "hot"}], "drinks": 3, "sauce": {"peper": 1}}
    assert explanation(data) == (
        "menu.toml: 6 faults: "
        "(1) [sauce] unknown ingredient 'peper'; did you mean 'pepper'? allowed: pepper, tomato; "
        "(2) unknown key 'drinks'; allowed: buffet, courses, plain, sauce, tables, vegan; "
        "(3) vegan is 1; allowed: true or false; "
        "(4) [courses number 1] name is 'a b'; allowed: one word; "
        "(5) [courses number 1] hours is 0; allowed: above 0.0; "
        "(6) [courses number 2] missing key 'name'"
    )


def test_a_misspelt_key_is_one_fault_and_not_a_missing_one_as_well() -> None:
    assert "faults" not in explanation({"course": [SOUP]})


@pytest.mark.parametrize(("count", "told"), [(8, 8), (9, 8), (100, 8), (50_000, 8)])
def test_many_faults_are_some_faults_and_how_many_more(count: int, told: int) -> None:
    message = explanation({"courses": [SOUP], "tables": {str(i): 0 for i in range(count)}})
    assert message.startswith(f"menu.toml: {count} faults: (1) [tables] 0 is 0; allowed: a table; (2) ")
    assert message.count("allowed: ") == told
    assert message.endswith(f"; and {count - told} more") == (count > told)


def test_long_faults_end_before_the_line_does() -> None:
    message = explanation({"courses": [SOUP], **{f"{i}" + "x" * 999: 0 for i in range(7)}})
    assert message.startswith("menu.toml: 7 faults: (1) unknown key '0xxx")
    assert re.search(r"; and \d more$", message)


def test_a_misspelt_key_comes_before_the_key_that_is_missing_for_it() -> None:
    assert "did you mean 'name'" in explanation({"courses": [{"nome": "soup"}]})


@pytest.mark.parametrize("key", ["a\nb", "\x00" * 999, "é" * 999, "\u2028"])
def test_a_key_cannot_break_the_line(key: str) -> None:
    assert "allowed: buffet, courses" in explanation({key: 1})
    assert "allowed: guests" in explanation({"courses": [SOUP], "tables": {key: {**SOUP, key: 1}}})


def test_a_deep_value_is_one_line() -> None:
    deep: dict[str, Any] = {}
    for _ in range(100_000):
        deep = {"a": deep}
    assert explanation({"courses": [SOUP], "vegan": deep}) == "menu.toml: vegan is a table; allowed: true or false"
    while deep:
        deep = deep.pop("a")  # taken apart in steps, which costs Python no stack
