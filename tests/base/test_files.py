"""Files that are there whole or not at all, and where none can be."""

from __future__ import annotations

import os
import stat

import pytest

from pendbench.base.errors import InputError
from pendbench.base.files import file_path, write_whole


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names here")
def test_a_pipe_is_written_to_and_stays_one(tmp_path):
    """As /dev/stdout is, and /dev/null, which the root of a container could replace by a file."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        assert file_path(pipe, "--out") == pipe
        write_whole(pipe, lambda file: file.write(b"whole"))
        assert os.read(reader, 100) == b"whole"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


def test_a_link_stays_one(tmp_path):
    (tmp_path / "a").write_text("before")
    (tmp_path / "link").symlink_to("a")
    write_whole(tmp_path / "link", lambda file: file.write(b"after"))
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "a").read_text() == "after"


def test_what_stops_on_the_way_leaves_what_was_there(tmp_path):
    file = tmp_path / "a"
    file.write_bytes(b"before")

    def half(out):
        out.write(b"half")
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="full"):
        write_whole(file, half)
    assert file.read_bytes() == b"before"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_what_is_no_file_to_write_is_one_line_and_nothing_is_made(tmp_path):
    (tmp_path / "file").write_text("")
    for wrong, said in (
        ("", "is empty"),
        (5, "is 5"),
        (tmp_path, "is a folder"),
        (tmp_path / "file" / "b", "below a file"),
    ):
        with pytest.raises(InputError, match=said) as caught:
            file_path(wrong, "--out")
        assert str(caught.value).endswith("; allowed: a file to write")
    assert file_path(tmp_path / "new" / "b", "--out") == tmp_path / "new" / "b"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="there is no /proc here")
def test_a_drive_that_refuses_what_permissions_allow_is_found_before_the_work():
    with pytest.raises(InputError, match=r"--out /proc/a.html: .*; allowed: a file to write"):
        file_path("/proc/a.html", "--out")
