"""The formats in which a gate's findings travel: JUnit, a summary, annotations, a badge."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import Final
from xml.etree import ElementTree

from pendbench.base.errors import printable
from pendbench.commands.gate_record import Gate
from pendbench.engines.conformance.check import ERROR, FAILED, PASSED, SKIPPED, Finding
from pendbench.report.numbers import number_text

_MOST_ANNOTATIONS: Final = 10  # GitHub shows no more of a step


def name_of(found: Finding) -> str:
    """What a finding is of, beside its method."""
    return f"{found.check} [{found.about}]" if found.about else found.check


def junit_text(gate: Gate) -> str:
    """A test case for each finding: the engine and its method as the class, value and limit as properties."""
    counts = {"failures": gate.count(FAILED), "errors": gate.count(ERROR), "skipped": gate.count(SKIPPED)}
    attributes = {"tests": str(len(gate.checks)), **{key: str(count) for key, count in counts.items()}}
    root = ElementTree.Element("testsuites", attributes)
    suite = ElementTree.SubElement(root, "testsuite", {"name": _clean(f"pendbench gate {gate.engine}"), **attributes})
    _properties(suite, {"engine": gate.engine, "version": gate.version, "precision": gate.precision})
    for found in gate.checks:
        _case(suite, gate, found)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _case(suite: ElementTree.Element, gate: Gate, found: Finding) -> None:
    of = ".".join(filter(None, ("pendbench", gate.engine, found.method)))
    case = ElementTree.SubElement(suite, "testcase", {"classname": _clean(of), "name": _clean(name_of(found))})
    properties = {"value": repr(found.value), "limit": repr(found.limit)} if found.value == found.value else {}
    _properties(case, {**properties, "unit": found.unit, "limit from": found.limit_from})
    tags = {FAILED: "failure", ERROR: "error", SKIPPED: "skipped"}
    if found.status in tags:
        ElementTree.SubElement(case, tags[found.status], {"message": _clean(found.cause)})


def _properties(parent: ElementTree.Element, values: dict[str, str]) -> None:
    inside = ElementTree.SubElement(parent, "properties")
    for name, value in values.items():
        ElementTree.SubElement(inside, "property", {"name": name, "value": _clean(value)})


def _clean(text: str) -> str:
    """Text that XML can hold."""
    return printable(text)


def summary_text(gate: Gate) -> str:
    """The summary in Markdown, as a CI shows it."""
    from pendbench.report.template import render

    return render("gate.md.j2", {"gate": gate, "rows": list(_rows(gate)), "said": one_line(gate)})


def _rows(gate: Gate) -> Iterator[tuple[str, str, str, str, str]]:
    for found in gate.checks:
        if not found.good:
            yield found.method or "-", name_of(found), number_text(found.value), number_text(found.limit), found.cause


def one_line(gate: Gate) -> str:
    """The outcome in a line."""
    told = [f"{gate.count(status)} {status}" for status in (PASSED, FAILED, ERROR, SKIPPED) if gate.count(status)]
    return f"{gate.engine} {gate.version}: {'passed' if gate.passed else 'FAILED'} ({', '.join(told)})"


def summary_html(gate: Gate) -> str:
    """The summary for a notebook."""
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in _rows(gate))
    return f"<p>{escape(one_line(gate))}</p><table>{rows}</table>"


def annotation_lines(gate: Gate) -> Iterator[str]:
    """Lines that GitHub shows beside a run: the failures, up to as many as it shows."""
    for found in [each for each in gate.checks if not each.good][:_MOST_ANNOTATIONS]:
        title = _escaped(f"{gate.engine} {found.method}: {name_of(found)}").replace(":", "%3A").replace(",", "%2C")
        yield f"::error title={title}::{_escaped(found.cause)}"


def _escaped(text: str) -> str:
    return printable(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


_BADGE: Final = """<svg xmlns="http://www.w3.org/2000/svg" width="{whole}" height="20" role="img" aria-label="{said}">
<title>{said}</title>
<rect width="{left}" height="20" fill="#444"/><rect x="{left}" width="{right}" height="20" fill="{colour}"/>
<g fill="#fff" text-anchor="middle" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">
<text x="{middle}" y="14">{label}</text><text x="{centre}" y="14">{word}</text></g>
</svg>
"""
_LETTER: Final = 7  # px, and no letter of the font is wider on average


def badge_text(gate: Gate) -> str:
    """A badge: the engine, and how many of its checks it passed."""
    asked = len(gate.checks) - gate.count(SKIPPED)
    label, word = "pendbench", "passed" if gate.passed else f"{gate.count(PASSED)} of {asked}"
    left, right = (12 + _LETTER * len(text) for text in (label, word))
    places = {"whole": left + right, "left": left, "right": right, "middle": left / 2, "centre": left + right / 2}
    said = escape(one_line(gate), quote=True)
    return _BADGE.format(said=said, colour="#2a7d2a" if gate.passed else "#b3261e", label=label, word=word, **places)
