# PYTHON_ARGCOMPLETE_OK
"""The command `pendbench`, which is ``python -m pendbench``, too.

A file of `pendbench.commands` whose first line says ```pendbench NAME`: what it does`` is the verb of that name, and
there is no list of them. It offers ``add_options(parser)`` and ``run(chosen)``, which gives the exit code, and loads
nothing heavy before it runs: help and completion have to be quick.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Final, NoReturn, Protocol, cast

from pendbench import __version__, commands
from pendbench.base.errors import InputError, choose
from pendbench.commands.shell import Parser, chosen, exit_code, leave, terminate

_VERB: Final = re.compile(r'"""`pendbench (\w+)`: (.+?)\.?(?:""")?$')


class Command(Protocol):
    """What the file of a verb offers."""

    add_options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def verbs() -> dict[str, str]:
    """What each verb does, by its name."""
    firsts = [_first_line(file) for file in sorted(Path(commands.__path__[0]).glob("*.py"))]
    found = [_VERB.match(line) for line in firsts]
    return {verb[1]: verb[2] for verb in found if verb}


def _first_line(file: Path) -> str:
    with file.open(encoding="utf-8") as lines:
        return lines.readline().rstrip()


def parser(words: Iterable[str]) -> tuple[Parser, dict[str, argparse.ArgumentParser]]:
    """The options of the command, and of each verb. Only a verb that is one of the words is loaded."""
    options = Parser(
        prog="pendbench",
        description="How far can you trust a physics engine? Chains of pendulums against an analytic reference.",
        epilog="`pendbench VERB --help` says more. Exit code: 0 done; 1 something got worse; 2 bad input.",
    )
    options.add_argument("--version", action="version", version=f"pendbench {__version__}")
    places = options.add_subparsers(dest="verb", metavar="VERB", title="verbs", parser_class=Parser)
    own: dict[str, argparse.ArgumentParser] = {}
    for name, does in verbs().items():
        own[name] = places.add_parser(name, help=does, description=f"{does[0].upper()}{does[1:]}.")
        if name in words:
            _command(name).add_options(own[name])
    return options, own


def _command(verb: str) -> Command:
    return cast(Command, import_module(f"pendbench.commands.{verb}"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    signal.signal(signal.SIGTERM, terminate)
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    given = list(sys.argv[1:] if arguments is None else arguments)
    return exit_code(lambda: _run(given), lambda: _keeps(given))


def _keeps(given: Sequence[str]) -> bool:
    """Whether the verb keeps what it has finished; one that does not has KEEPS = False."""
    return bool(getattr(_command(given[0]), "KEEPS", True)) if given and given[0] in verbs() else True


def _run(given: Sequence[str]) -> int:
    verb = given[0] if given else ""
    options, own = parser([verb])
    if verb in own:
        return _command(verb).run(chosen(own[verb], given[1:]))
    if verb and not verb.startswith("-"):
        raise InputError(choose("verb", verb, own))
    chosen(options, given)  # --help and --version leave here
    raise InputError(f"which verb? allowed: {', '.join(own)}; --help says what they do")


def _complete() -> None:
    """Answer a shell that asks how a line goes on, and leave."""
    import argcomplete

    argcomplete.autocomplete(parser(os.environ.get("COMP_LINE", "").split())[0])


def command() -> NoReturn:
    """The command `pendbench`."""
    leave(main())


if __name__ == "__main__":
    command()
