"""The league's tables in the documentation are those of a report, with what they come from."""

from __future__ import annotations

import json

import pytest

from pendbench.base.errors import InputError
from pendbench.commands.league_page import tables_of, with_tables

HERE = "| engine | verdict |\n| --- | --- |\n| analytic | exact |\n| mujoco | fair |"
OTHERS = "| engine | verdict |\n| --- | --- |\n| mujoco | fair |"
BEATS = "| engine | beats |\n| --- | --- |\n| analytic | all |"
FACTS = {
    "kind": "league", "quick": False, "engine analytic": "0.1.0", "engine mujoco": "4.0.1",
    "engine newton": "left out: it hangs", "processor": "a processor", "python": "3.11.7", "seed": None,
}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "report.md").write_text(
        f"# The league\n\n{HERE}\n\nText\n\n## Without our own engine\n\n{OTHERS}\n\nText\n\n"
        f"## The Pendulum Challenge\n\n### challenge\n\n{BEATS}\n\nText\n### challenge_four\n\n{OTHERS}\n"
    )
    (tmp_path / "provenance.json").write_text(json.dumps(FACTS))
    return tmp_path


def test_both_tables_the_versions_and_the_machine_are_written(folder):
    found = tables_of(folder, "1 May")
    assert HERE in found
    assert found.index(OTHERS, found.index("Without our own:")) > 0
    assert found.startswith("1 May, in full.")
    assert "Versions: analytic 0.1.0, mujoco 4.0.1." in found
    assert "Not there: newton." in found
    assert "processor a processor" in found


def test_each_scene_of_the_challenge_has_its_table(folder):
    found = tables_of(folder, "1 May")
    assert f"The Pendulum Challenge, scene `challenge`:\n\n{BEATS}\n" in found
    assert f"scene `challenge_four`:\n\n{OTHERS}\n" in found


def test_they_take_the_place_of_the_last_ones(folder):
    page = "before\n<!-- tables -->\nold\n<!-- end of tables -->\nafter\n"
    found = with_tables(page, folder, "1 May")
    assert found.startswith("before\n<!-- tables -->\n")
    assert found.endswith("<!-- end of tables -->\nafter\n")
    assert "old" not in found
    assert with_tables(found, folder, "1 May") == found


@pytest.mark.parametrize("kind", [None, "chaos"])
def test_a_folder_of_something_else_is_one_line(folder, kind):
    if kind is None:
        (folder / "provenance.json").unlink()
    else:
        (folder / "provenance.json").write_text(json.dumps(FACTS | {"kind": kind}))
    with pytest.raises(InputError, match="allowed: the folder of a league's results"):
        tables_of(folder, "1 May")
