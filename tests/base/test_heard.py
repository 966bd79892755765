"""Whatever is written in a block is heard there, and nowhere else."""

from __future__ import annotations

import os
import sys

from pendbench.base.heard import heard


def test_both_streams_and_those_of_other_languages_are_heard(capfd):
    with heard() as said:
        print("one")
        print("two", file=sys.stderr)
        os.write(1, b"three")
    print("after")
    assert all(word in said[0] for word in ("one", "two", "three"))
    assert capfd.readouterr().out == "after\n"


def test_silence_is_nothing():
    with heard() as said:
        pass
    assert said == []
