"""`pendbench.compare`: what got better or worse between two sets of results."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendbench.base.errors import InputError
from pendbench.base.strict import shown_path
from pendbench.commands.gate_record import Gate, write_text
from pendbench.commands.sides import Results, read_side

if TYPE_CHECKING:
    from pendbench.study.comparison import Change, Compared

_MOST_NAMES: Final = 200
_TEMPLATE: Final = "compare.md.j2"
#: Times are compared where these are the same, as far as is known.
_MACHINE: Final = ("processor", "logical processors", "threads per engine")


@dataclass(frozen=True)
class Comparison:
    """What became of cases from `a` to `b`. found: all of it. around: what differs around them: of what, there, here.

    clock: whether times were compared.
    """

    a: str
    b: str
    kind: str
    found: Compared
    around: tuple[tuple[str, str, str], ...] = ()
    clock: bool = True

    @property
    def better(self) -> tuple[Change, ...]:
        """What got better."""
        return self.found.of("better")

    @property
    def worse(self) -> tuple[Change, ...]:
        """What got worse."""
        return self.found.of("worse")

    @property
    def lost(self) -> tuple[str, ...]:
        """What `a` has and `b` does not: who lost a result cannot say that it is as good as it was."""
        return self.found.gone

    @cached_property
    def answer(self) -> str:
        """The outcome in a few sentences, on one line."""
        from pendbench.report.template import render_block

        return render_block(_TEMPLATE, "answer", self._facts)

    def markdown(self) -> str:
        """The report."""
        from pendbench.report.template import render

        return render(_TEMPLATE, self._facts)

    def html(self) -> str:
        """The same for a browser."""
        from pendbench.report.html_page import html_page

        return html_page(self.markdown(), self.answer, {})

    def save(self, out: str | os.PathLike[str]) -> None:
        """Write compare.md and compare.html into a folder. Raises InputError where they cannot be written."""
        texts = {"compare.html": self.html(), "compare.md": self.markdown()}
        for name, text in texts.items():
            write_text(Path(out) / name, text)

    def _repr_html_(self) -> str:
        from html import escape

        lines = "".join(f"<li>{escape(line_of(each))}</li>" for each in (*self.worse, *self.better))
        return f"<p>{escape(self.answer)}</p><ul>{lines}</ul>"

    @property
    def _facts(self) -> dict[str, Any]:
        from pendbench.study.changes import BETTER, SAME, UNTOLD, WORSE

        its, outcomes = self.found, (BETTER, WORSE, SAME, UNTOLD)
        abouts = list(dict.fromkeys(each.about for each in its.changes))
        untold: dict[str, int] = {}
        for each in its.of(UNTOLD):
            reason = each.why.partition(":")[0]
            untold[reason] = untold.get(reason, 0) + 1
        return {
            "comparison": self,
            "found": its,
            "lists": (
                (f"Only in {self.a}", its.gone),
                (f"Only in {self.b}", its.new),
                ("Skipped by one of them" if self.kind == "gate" else "Another scene by the same name", its.skipped),
            ),
            "most": _MOST_NAMES,
            "better": self.better,
            "worse": self.worse,
            "untold": untold,
            "tally": [(about, *(_count(its, about, each) for each in outcomes)) for about in abouts],
        }


def line_of(change: Change) -> str:
    """A change in a line."""
    from pendbench.report.numbers import number_text

    was, now = (each if isinstance(each, str) else number_text(each) for each in (change.was, change.now))
    why = f" ({change.why})" if change.why else ""
    return f"{change.outcome}: {change.case}: {change.what} was {was}, is {now}{why}"


def _count(found: Compared, about: str, outcome: str) -> int:
    return sum(each.about == about for each in found.of(outcome))


def compare(a: str | os.PathLike[str], b: str | os.PathLike[str]) -> Comparison:
    """What got better or worse from `a` to `b`, with what is noise told from what is not.

    a, b: folders of a study's results, each of one run or with a folder for each of several; or JSON files of gates.

    >>> import pendbench as pb
    >>> found = pb.compare("results/before", "results/after")  # doctest: +SKIP
    >>> found.answer, found.worse, found.better  # doctest: +SKIP

    Raises InputError, one line, for what is neither, of two kinds, or has no case in common.
    """
    before, after = read_side(a), read_side(b)
    if isinstance(before, Gate) and isinstance(after, Gate):
        found = _of_gates(before, after, shown_path(a), shown_path(b))
    elif isinstance(before, Results) and isinstance(after, Results):
        found = _of_studies(before, after)
    else:
        raise InputError(f"{shown_path(a)} and {shown_path(b)}: results of a study and a gate; allowed: two of a kind")
    if not found.found.changes and not found.found.skipped:
        raise InputError(f"{found.a} and {found.b}: have nothing in common; allowed: results of the same cases")
    return found


def _of_gates(before: Gate, after: Gate, a: str, b: str) -> Comparison:
    from pendbench.study.comparison import compare_checks

    names = {"engine": "engine", "version": "its version", "precision": "precision", "seed": "seed",
             "made_by": "pendbench"}  # fmt: skip
    pairs = ((said, str(getattr(before, name)), str(getattr(after, name))) for name, said in names.items())
    around = tuple(pair for pair in pairs if pair[1] != pair[2])
    return Comparison(a, b, "gate", compare_checks(before.checks, after.checks), around)


def _of_studies(before: Results, after: Results) -> Comparison:
    from pendbench.study.comparison import compare_cases

    if not before.alike(after):
        raise InputError(
            f"{before.where} and {after.where}: studies of the kinds {before.kind} and {after.kind}; "
            "allowed: two of one kind"
        )
    clock = not any(before.differs(after, name) for name in _MACHINE)
    scenes = [name for name in before.provenance if name.startswith("scene ") and before.differs(after, name)]
    others = {name.removeprefix("scene ") for name in scenes}
    found = compare_cases(before.tables, after.tables, clock=clock, others=others)
    return Comparison(before.where, after.where, before.kind, found, tuple(_around(before, after)), clock)


def _around(before: Results, after: Results) -> Iterator[tuple[str, str, str]]:
    """What the results say of where they are from, and differs."""
    for name in sorted({*before.provenance, *after.provenance}):
        was, now = (str(side.provenance.get(name, "not known")) for side in (before, after))
        if was != now:
            yield name, was, now
