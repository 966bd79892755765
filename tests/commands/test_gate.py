"""The gate: every check apart, whatever the engine does; in every format of CI; from the command, Python and pytest."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

import pendbench as pb
from pendbench.__main__ import main
from pendbench.base.errors import InputError
from pendbench.commands.gate_formats import annotation_lines, badge_text, junit_text, summary_text
from pendbench.commands.gate_record import Gate, json_text, read_gate
from pendbench.commands.gating import run_gate
from pendbench.engines.conformance.check import Finding
from pendbench.engines.gating import gate as gating
from pendbench.engines.gating.functions import FunctionEngine
from pendbench.engines.gating.gate import Asked, names_of_checks
from pendbench.execution.pool import Job
from support import gate_engines

ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests"
FEW = ("describes itself", "starts at the start", "mirrors", "owns up")


class Silent:
    def begin(self, stage, total, done):
        pass

    def advance(self):
        pass


def asked(source, **others) -> Gate:
    return run_gate(Asked(source, **{"workers": 1, "checks": FEW, "time_limit": 5.0, **others}), Silent())


def by_check(gate: Gate) -> dict[str, Finding]:
    return {each.check: each for each in gate.checks}


@pytest.fixture(scope="module")
def right():
    """A gate of a right engine, as a class of a module."""
    return asked("support.gate_engines:right", checks=())


def test_a_right_engine_passes(right):
    assert right.passed
    assert right.failures == ()
    assert right.isolated
    assert {each.check for each in right.checks} == set(names_of_checks())


@pytest.mark.parametrize(
    ("name", "status", "cause"),
    [
        ("raising", "error", "raised RuntimeError: five is too many"),
        ("leaving", "error", "tried to exit the program (SystemExit: 3)"),
        ("crashing", "error", "crashed: the process died with exit code 3"),
        ("hanging", "error", "timed out: took longer than 1 s of processor time"),
        ("sleeping", "error", "timed out: took longer than 3 s by the clock"),
    ],
)
def test_what_an_engine_does_to_one_check_is_said_there_and_the_others_are_asked(monkeypatch, name, status, cause):
    def job(key, function, arguments, time_limit, *, wall_limit):
        assert (time_limit, wall_limit) == (5.0, 50.0)
        if key == "rk4:owns up":  # these two use up any limit, so a short one will do
            time_limit, wall_limit = {"hanging": (1.0, 50.0), "sleeping": (5.0, 3.0)}.get(name, (5.0, 50.0))
        return Job(key, function, arguments, time_limit, wall_limit=wall_limit)

    monkeypatch.setattr(gating, "Job", job)
    gate = asked(f"support.gate_engines:{name}")
    found = by_check(gate)
    assert found["owns up"].status == status
    assert found["owns up"].cause.startswith(cause)
    assert {found[check].status for check in FEW[:-1]} == {"passed"}
    assert not gate.passed


@pytest.mark.parametrize(
    ("source", "cause"),
    [
        ("support.gate_engines:exiting_at_once", "it cannot be loaded (SystemExit: 7)"),
        ("support.gate_engines:dying_at_once", "it cannot be loaded: crashed: the process died with exit code 7"),
        ("support.gate_engines:nobody", "it cannot be loaded (AttributeError: "),
        ("no_such_module_here:Engine", "it cannot be loaded (ModuleNotFoundError: "),
        ("collections:OrderedDict", "not an engine: it has no name"),
    ],
)
def test_an_engine_that_cannot_be_loaded_is_a_failed_check(source, cause):
    gate = asked(source)
    (only,) = gate.checks
    assert (only.check, only.status) == ("loads", "error")
    assert only.cause.startswith(cause)


def test_one_that_prints_as_it_is_loaded_is_told_so_and_asked_all_the_same():
    found = by_check(asked("support.gate_engines:printing_at_once"))
    assert found["loads"].cause == "loading it, it prints 'hello from a library'"
    assert {found[check].status for check in FEW} == {"passed"}


def test_an_engine_of_two_functions():
    found = pb.gate(step=gate_engines.step, state=gate_engines.state, health=gate_engines.health, jobs=2)
    assert found.passed, found.failures
    assert found.isolated


def test_functions_that_cannot_be_sent_to_a_process_are_asked_in_this_one():
    engine = FunctionEngine(lambda world: gate_engines.step(world), gate_engines.state, order=2)  # noqa: PLW0108
    found = asked(engine, checks=("starts at the start", "converges"))
    assert not found.isolated
    assert by_check(found)["converges"].cause.startswith("its order is 1.0")


@pytest.mark.parametrize(
    ("gives", "said"),
    [
        (lambda world: None, "state() gives None; allowed"),  # noqa: ARG005
        (lambda world: world.theta, "state() gives float64 (), float64 (); allowed: angles and rates, 2 numbers each"),
        (lambda world: (world.theta[:1], world.omega), "state() gives float64 (1,), float64 (2,); allowed"),
        (lambda world: (world.theta, world.omega * 1j), "state() gives float64 (2,), complex128 (2,); allowed"),
        (lambda world: (world.theta, world.omega, world.omega), "float64 (2,), float64 (2,), float64 (2,); allowed"),
    ],
)
def test_a_state_that_is_none_is_told_what_it_should_be(gives, said):
    run = FunctionEngine(gate_engines.step, gives).build(pb.load_scene("double"), "step", 0.01)
    with pytest.raises(ValueError, match=re.escape(said)):
        run.state()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "step is None; allowed: a function, where no engine is given"),
        ({"engine": "pymunk", "step": print}, "engine and functions are given; allowed: one of them"),
        ({"engine": " "}, "engine is empty"),
        ({"engine": "pymnk"}, "unknown engine 'pymnk'; did you mean 'pymunk'?"),
        ({"engine": "pymunk", "methods": "tund"}, "engine 'pymunk': unknown method 'tund'; did you mean 'tuned'?"),
        ({"engine": "pymunk", "seed": -1}, "seed is -1; allowed: a whole number from 0 on"),
        ({"engine": "pymunk", "jobs": 1000}, "jobs is 1000; allowed: 0 to 64"),
        ({"engine": "pymunk", "time_limit": "long"}, "time_limit is 'long'; allowed: a number from 1 to"),
        ({"engine": "pymunk", "methods": 5}, "methods is 5; allowed: the name of a method, or several"),
        ({"engine": "no/module:Class"}, "engine is 'no/module:Class'; allowed: a name, or module:Class"),
        ({"engine": "module:"}, "engine is 'module:'; allowed: a name, or module:Class"),
        ({"step": print, "state": print, "effects": "gravty"}, "unknown effect 'gravty'; did you mean 'gravity'?"),
        ({"step": print, "state": print, "effects": 5}, "effects is 5; allowed: the name of an effect, or several"),
        ({"step": print, "state": print, "health": 5}, "health is 5; allowed: a function, or None"),
        ({"step": print, "state": print, "name": ""}, "name is ''; allowed: a text"),
        ({"step": print, "state": print, "order": 0}, "order is 0; allowed: a whole number from 1 on"),
        ({"step": print, "state": print, "precision": "half"}, "precision is 'half'; allowed: double or single"),
    ],
)
def test_bad_input_is_one_line(given, said):
    with pytest.raises(InputError) as caught:
        pb.gate(**given)
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_the_json_reads_back(right, tmp_path):
    right.to_json(tmp_path / "gate.json")
    again = read_gate(tmp_path / "gate.json")
    assert json_text(again) == json_text(right)
    content = json.loads((tmp_path / "gate.json").read_text())
    assert (content["schema"], content["schema_version"], content["passed"]) == ("pendbench.gate", 1, True)
    page = (ROOT / "docs/gate.md").read_text()
    for key in (*content, *content["engine"], *content["checks"][0]):
        assert f"`{key}`" in page, f"docs/gate.md does not say what {key} is"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "is not JSON"),
        ("{}", "is not the JSON of a gate"),
        ('{"schema": "pendbench.gate", "schema_version": 99}', "schema_version is 99; allowed: 1"),
        ('{"schema": "pendbench.gate", "schema_version": 1}', "'engine' is missing or wrong"),
    ],
)
def test_a_file_that_is_no_gate_is_one_line(content, said, tmp_path):
    (tmp_path / "gate.json").write_text(content)
    with pytest.raises(InputError, match=r"gate\.json") as caught:
        read_gate(tmp_path / "gate.json")
    assert said in str(caught.value)


def finding(status: str = "failed", cause: str = "it is 50 % off: <here>\n", **others) -> Finding:
    values = {"check": "mirrors", "method": "rk4", "about": "", "value": 2.5, "limit": 1e-9, "unit": "rad"}
    return Finding(**{**values, "status": status, "cause": cause, "limit_from": "rounding", **others})


BAD = Gate(
    "mine",
    "1.0",
    "double",
    0,
    True,
    (
        finding("passed", "", value=0.0),
        finding(about="two links"),
        finding("error", "raised X", value=float("nan"), limit=float("nan")),
        finding("skipped", "nothing to measure", value=float("nan"), limit=float("nan")),
    ),
)


def test_junit_has_a_case_for_each_finding():
    root = ElementTree.fromstring(junit_text(BAD))
    assert {key: root.get(key) for key in ("tests", "failures", "errors", "skipped")} == {
        "tests": "4",
        "failures": "1",
        "errors": "1",
        "skipped": "1",
    }
    cases = root.findall("testsuite/testcase")
    assert [case.get("name") for case in cases] == ["mirrors", "mirrors [two links]", "mirrors", "mirrors"]
    assert {case.get("classname") for case in cases} == {"pendbench.mine.rk4"}
    failure = cases[1].find("failure")
    assert failure is not None
    assert failure.get("message") == "it is 50 % off: <here>\\n"
    told = {its.get("name"): its.get("value") for its in cases[1].findall("properties/property")}
    assert told == {"value": "2.5", "limit": "1e-09", "unit": "rad", "limit from": "rounding"}


def test_annotations_are_escaped_for_github():
    first, second = annotation_lines(BAD)
    assert first == "::error title=mine rk4%3A mirrors [two links]::it is 50 %25 off: <here>\\n"
    assert second == "::error title=mine rk4%3A mirrors::raised X"


def test_the_summary_shows_what_is_wrong():
    page = summary_text(BAD)
    assert "mine 1.0: FAILED (1 passed, 1 failed, 1 error, 1 skipped)" in page.replace("\\", "")
    assert "two links" in page
    assert "2.5" in page


def test_the_badge_is_a_picture_that_says_how_many(right):
    words = ["".join(ElementTree.fromstring(badge_text(gate)).itertext()) for gate in (BAD, right)]
    assert "1 of 3" in words[0]
    assert "passed" in words[1]


def test_the_command_writes_its_files_and_tells_its_ci(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    files = {kind: tmp_path / f"gate.{kind}" for kind in ("json", "junit", "badge")}
    options = [word for kind, path in files.items() for word in (f"--{kind}", str(path))]
    assert main(["gate", "support.gate_engines:wrong", "--methods", "rk4", *options]) == 1
    told = capfd.readouterr().out
    assert "rk4, converges: its order is 3.9" in told
    assert "::error title=tampered rk4%3A converges::its order is 3.9" in told
    assert not read_gate(files["json"]).passed
    assert ElementTree.parse(files["junit"]).getroot().get("failures") == "1"
    assert "FAILED" in (tmp_path / "summary.md").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["pymnk"], "unknown engine 'pymnk'"),
        (["pymunk", "--json", ""], "--json is empty"),
        (["pymunk", "--junit", "."], "--junit .: is a folder"),
        (["pymunk", "--json", f"{__file__}/a.json"], "lies below a file"),
        (["pymunk", "--json", "a", "--badge", "a"], "--badge a: is --json, too"),
        (["pymunk", "--seed", "x"], "--seed is 'x'; allowed: a whole number"),
        (["pymunk", "--jobs", "0"], "--jobs is 0; allowed: 1 to 64"),
        (["pymunk", "--time-limit", "-1"], "--time-limit is -1"),
        (["pymunk", "--seed", "-1"], "--seed is -1"),
    ],
)
def test_bad_input_at_the_command_line(words, said, capsys):
    assert main(["gate", *words]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert len(told.strip().splitlines()[-1:]) == 1


def run_pytest(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    settings = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])}
    call = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:pendbench",
        "-p",
        "pendbench.commands.pytest_plugin",
        "-q",
        *words,
    ]
    return subprocess.run(call, cwd=folder, env=settings, capture_output=True, text=True, check=False)


def test_pytest_has_a_test_for_each_check(tmp_path):
    (tmp_path / "test_own.py").write_text(
        "def test_it(pendbench_gate):\n"
        "    found = pendbench_gate()\n"
        "    assert found.engine == 'tampered' and not found.passed\n"
    )
    done = run_pytest(tmp_path, "--pendbench", "support.gate_engines:wrong")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "rk4, converges: its order is 3.9" in done.stdout
    assert "1 failed" in done.stdout
    assert "INTERNALERROR" not in done.stdout


def test_the_plugin_is_inert_unless_it_is_asked(tmp_path):
    (tmp_path / "test_own.py").write_text(
        "import sys\ndef test_it():\n    assert not [name for name in sys.modules if 'pendbench.engines' in name]\n"
    )
    done = run_pytest(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout


def test_the_steps_of_the_action_run(tmp_path):
    yaml = pytest.importorskip("yaml", reason="reads the action as GitHub does")
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    install, gate = action["runs"]["steps"]
    assert install["run"] == 'python -m pip install --quiet "$GITHUB_ACTION_PATH"'
    given = {name: its.get("default", "") for name, its in action["inputs"].items()}
    given |= {"engine": "support.gate_engines:wrong", "methods": "rk4"}
    own = {key: given[text.removeprefix("${{ inputs.").removesuffix(" }}")] for key, text in gate["env"].items()}
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    settings = {**os.environ, **own, "PATH": path, "PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])}
    call = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", gate["run"]]
    done = subprocess.run(call, cwd=tmp_path, env=settings, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout + done.stderr
    assert not read_gate(tmp_path / "pendbench/gate.json").passed
    assert {path.name for path in (tmp_path / "pendbench").iterdir()} == {"gate.json", "gate.xml", "gate.svg"}


def test_workflows_of_the_docs_are_yaml_and_name_options_that_there_are():
    yaml = pytest.importorskip("yaml", reason="reads the workflows")
    blocks = (ROOT / "docs/gate.md").read_text().split("```yaml\n")[1:]
    flows = [yaml.safe_load(block.split("```")[0]) for block in blocks]
    assert len(flows) == 2
    inputs = yaml.safe_load((ROOT / "action.yml").read_text())["inputs"]
    step = next(step for step in flows[0]["jobs"]["gate"]["steps"] if "pendbench" in str(step.get("uses")))
    assert set(step["with"]) <= set(inputs)
    assert any("pendbench gate" in line for line in flows[1]["gate"]["script"])
