"""What an engine says of itself, asked such that no engine can end a study with its answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pendbench.base.errors import describe, printable
from pendbench.base.faults import Fault
from pendbench.engines import protocol
from pendbench.engines.registry import engine
from pendbench.execution.runner import Runner
from pendbench.execution.tasks import task
from pendbench.study.case import Case


@dataclass(frozen=True)
class Refusals:
    """Why an engine refuses each of some cases, None where it does not."""

    status: str
    reason: str = ""
    reasons: tuple[str | None, ...] = ()


def ask_refusals(cases: tuple[Case, ...]) -> Refusals:
    """Ask the engine of these cases which of them it refuses."""
    return Refusals("ok", reasons=tuple(map(_refusal, cases)))


def _refusal(case: Case) -> str | None:
    try:
        reason = protocol.refusal(engine(case.engine), case.method, case.scene)
    except (Exception, SystemExit):
        return None
    return None if reason is None else printable(str(reason))


def refused(runner: Runner, cases: Sequence[Case]) -> dict[Case, Fault]:
    """The cases that their engines refuse, each with the reason. An engine that fails to say will fail to run, too."""
    groups: dict[tuple[str, str], list[Case]] = {}
    for case in cases:
        groups.setdefault((case.engine, case.scene.name), []).append(case)
    found = runner.run("what engines refuse", {tuple(own): task(ask_refusals, tuple(own)) for own in groups.values()})
    pairs = [pair for own, answer in found.items() for pair in zip(own, answer.reasons, strict=False)]
    return {case: Fault("refused", reason) for case, reason in pairs if reason is not None}


def version(name: str) -> str:
    """The version of the program behind an engine, or why it is not known."""
    try:
        return printable(str(engine(name).version()))
    except (Exception, SystemExit) as error:
        return f"not known ({describe(error)})"
