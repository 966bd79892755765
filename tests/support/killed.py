"""Programs that end themselves at a certain moment: to kill them from outside at the right time would need luck."""

from __future__ import annotations

import signal
import subprocess
import sys

_CODE = """
import os, signal, sys
from pathlib import Path
from pendbench.study.__main__ import main

pattern, left, replace = sys.argv[1], int(sys.argv[2]), os.replace

def replace_or_die(source, target):
    global left
    left -= Path(target).match(pattern)
    if left == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    replace(source, target)

os.replace = replace_or_die
main(sys.argv[3:])
"""


def killed_in_writing(pattern: str, count: int, *arguments: object) -> None:
    """Run a study that is killed, it alone, in writing so many files of this pattern: the last is not in place yet."""
    line = [sys.executable, "-c", _CODE, pattern, str(count), *map(str, arguments)]
    ran = subprocess.run(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
    assert ran.returncode == -signal.SIGKILL, ran.stderr.decode()
