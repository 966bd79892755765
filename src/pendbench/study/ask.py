"""What an engine says of itself, asked in the main process such that no engine can end a study with its answer."""

from __future__ import annotations

from pendbench.engines import protocol
from pendbench.engines.registry import engine
from pendbench.errors import describe, printable
from pendbench.study.case import Case


def refusal(case: Case) -> str | None:
    """Why the engine cannot simulate the case's scene, or None. An engine that fails to say will fail to run, too."""
    try:
        reason = protocol.refusal(engine(case.engine), case.method, case.scene)
    except (Exception, SystemExit):
        return None
    return None if reason is None else printable(str(reason))


def version(name: str) -> str:
    """The version of the program behind an engine, or why it is not known."""
    try:
        return printable(str(engine(name).version()))
    except (Exception, SystemExit) as error:
        return f"not known ({describe(error)})"
