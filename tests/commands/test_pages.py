"""The documentation: pages that follow from the code are in step with it, and every link leads somewhere."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pendbench.base.faults import STATUSES
from pendbench.commands.api_page import api_page
from pendbench.commands.pages import checks_page, columns_page, files_page
from pendbench.study.kinds import kind, kinds, part_of_kind
from pendbench.study.study_file import EngineTable, StudyFile

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])


@pytest.mark.parametrize(
    ("name", "page"),
    [("api", api_page), ("columns", columns_page), ("study_files", files_page), ("checks", checks_page)],
)
def test_generated_pages_are_in_step_with_the_code(name, page):
    assert (ROOT / f"docs/{name}.md").read_text("utf-8") == page(), "run python -m pendbench.commands.pages"


def test_every_column_and_every_key_is_documented():
    columns, files = columns_page(), files_page()
    for name in kinds():
        for table in part_of_kind(name, "columns").COLUMNS.values():
            assert all(f"| `{column.name}`" in columns and column.meaning and column.heading for column in table), name
        for key, field in kind(name).Options.model_fields.items():
            assert f"| `{key}` |" in files
            assert field.description, f"{name}: {key} has no words that say what it is"
    assert all(field.description for table in (EngineTable, StudyFile) for field in table.model_fields.values())


def test_every_status_and_every_table_has_its_line():
    measuring = (ROOT / "docs/measuring.md").read_text("utf-8")
    for status, meaning in STATUSES.items():
        assert f"\n| {status} | {meaning}" in measuring
    for name in kinds():
        assert all(f"`{table}.csv`" in measuring for table in part_of_kind(name, "columns").COLUMNS), name


@pytest.mark.parametrize("suffix", ["_s", "_rad", "_us"])
def test_units_in_names_are_the_declared_units(suffix):
    tables = [table for name in kinds() for table in part_of_kind(name, "columns").COLUMNS.values()]
    named = {c.name: c.unit for table in tables for c in table if re.search(rf"(?<!_per){suffix}$", c.name)}
    assert named
    assert set(named.values()) == {suffix.removeprefix("_")}, named


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files_and_headings_that_are_there(page):
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", page.read_text("utf-8")):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.*)$", file.read_text("utf-8"), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}, (
                target
            )
