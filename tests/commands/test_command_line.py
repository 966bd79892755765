"""The command line as people type it: exit codes, one line for what is wrong, nothing loaded or written in vain."""

from __future__ import annotations

import inspect
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import pendbench as pb
from pendbench.__main__ import main as pendbench
from pendbench.__main__ import verbs
from pendbench.commands import run as api
from pendbench.commands import study as command
from pendbench.report.page import Report
from pendbench.study import __main__ as command_line
from pendbench.study.results import Results
from support.controls import install
from support.tiny_study import Idle, Inline, write_study

LINE = [sys.executable, "-m", "pendbench.study"]
HEAVY = {"matplotlib", "mujoco", "numba", "numpy", "pandas", "pebble", "pydantic", "pymunk", "rich", "scipy", "sympy"}
HEAVY |= {"argcomplete"}


def loaded(*arguments: str) -> set[str]:
    """The modules that a Python loads, without what is inside them."""
    ran = subprocess.run([sys.executable, "-X", "importtime", *arguments], capture_output=True, text=True, check=False)
    names = re.findall(r"^import time:.*\|\s*(\S+)$", ran.stderr, re.MULTILINE)
    assert "pendbench" in names
    return {name.partition(".")[0] for name in names}


# What is loaded, and when.


@pytest.mark.parametrize("arguments", [["--help"], ["--list"], ["--lst"], []])
def test_what_needs_no_study_loads_none_of_it(arguments):
    assert not loaded("-m", "pendbench.study", *arguments) & HEAVY


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], [], *([verb, "--help"] for verb in verbs())])
def test_the_help_of_the_command_and_of_each_verb_loads_nothing_heavy(arguments):
    assert not loaded("-m", "pendbench", *arguments) & HEAVY


def test_importing_the_package_loads_no_engine_and_nothing_heavy():
    assert not loaded("-c", "import pendbench; dir(pendbench)") & HEAVY


def test_loading_a_scene_loads_no_engine():
    found = loaded("-c", "import pendbench; pendbench.load_scene('double')")
    assert not found & (HEAVY - {"numpy", "pydantic"})


def test_the_public_names_are_there_and_stay_there():
    code = """
import pendbench as pb
from importlib import import_module
kinds = {name: type(getattr(pb, name)).__name__ for name in pb.__all__}
for module in ("engines.recording", "truth.reference", "commands.run", "kinds.chaos.study"):
    import_module(f"pendbench.{module}")
assert {name: type(getattr(pb, name)).__name__ for name in pb.__all__} == kinds, "a module hides a function"
assert set(kinds.values()) <= {"function", "type"}, kinds
assert set(dir(pb)) == {*pb.__all__, "__version__"}
try:
    pb.nosuch
except AttributeError as error:
    assert "nosuch" in str(error)
else:
    raise AssertionError("anything is there")
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_lists_are_printed_and_the_exit_code_is_0(capsys):
    assert command_line.main(["--list"]) == 0
    listed = capsys.readouterr()
    assert re.search(r"^chaos +How long can you trust", listed.out, re.MULTILINE)
    assert listed.err == ""
    with pytest.raises(SystemExit) as left:
        command_line.main(["--help"])
    assert left.value.code == 0
    assert "NAME-or-FILE" in capsys.readouterr().out


def test_whoever_stops_reading_the_list_sees_no_error():
    ran = subprocess.run(
        [sys.executable, "-c", f"import subprocess, os\nr, w = os.pipe()\nos.close(r)\n"
         f"p = subprocess.run({[*LINE, '--list']!r}, stdout=w, stderr=subprocess.PIPE)\n"
         "print(p.returncode, p.stderr)"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ran.stdout == "0 b''\n"


# The command `pendbench`.


def test_the_command_is_installed_and_is_the_module():
    command = shutil.which("pendbench", path=str(Path(sys.executable).parent))
    assert command, "not installed: pip install -e ."
    for line in ([command], [sys.executable, "-m", "pendbench"]):
        ran = subprocess.run([*line, "--version"], capture_output=True, text=True, check=True)
        assert ran.stdout == f"pendbench {pb.__version__}\n"


def test_every_verb_says_what_it_does(capsys):
    with pytest.raises(SystemExit) as left:
        pendbench(["--help"])
    assert left.value.code == 0
    told = " ".join(capsys.readouterr().out.split())
    assert all(f"{verb} {does}" in told for verb, does in verbs().items())


def test_the_study_verb_is_the_study_command(capsys):
    assert pendbench(["study", "--list"]) == 0
    listed = capsys.readouterr().out
    assert command_line.main(["--list"]) == 0
    assert capsys.readouterr().out == listed


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "which verb? allowed: "),
        (["studdy"], "unknown verb 'studdy'; did you mean 'study'? allowed: "),
        (["--verison"], "unknown option '--verison'; did you mean '--version'? allowed: "),
        (["study"], "which study? a bundled name (--list shows them) or a path to a .toml file"),
        (["study", "chaos", "--jobz", "2"], "unknown option '--jobz'; did you mean '--jobs'? allowed: "),
        (["study", "chaos", "cost"], "'cost' after 'chaos'; allowed: one study"),
    ],
)
def test_what_the_command_cannot_use_is_one_line(capsys, arguments, said):
    assert pendbench(arguments) == 2
    shown = capsys.readouterr()
    assert (shown.out, shown.err.count("\n")) == ("", 1)
    assert shown.err.startswith(f"error: {said}")


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("pendbench st", "study"),
        ("pendbench study --qu", "--quick"),
        ("pendbench study cha", "chaos"),
        ("pendbench study chaos --scenes single,kapitza_", "single,kapitza_slow"),
        ("pendbench judge damp", "damped_double"),
    ],
)
def test_a_shell_is_told_how_a_line_goes_on(tmp_path, typed, offered):
    answer = tmp_path / "answer"
    asked = {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": typed, "COMP_POINT": str(len(typed)),
    }  # fmt: skip
    subprocess.run([sys.executable, "-m", "pendbench"], env={**os.environ, **asked}, check=False)
    assert answer.read_text().split() == [offered]


# Bad input.


@pytest.fixture
def study(tmp_path) -> Path:
    return write_study(tmp_path)


def refused(capsys, *arguments: object) -> str:
    """The one line that a bad command line gives."""
    assert command_line.main([*map(str, arguments)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    lines = said.err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    return lines[0].removeprefix("error: ")


def files(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*")}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "which study? a bundled name (--list shows them) or a path to a .toml file"),
        (["--quik"], "unknown option '--quik'; did you mean '--quick'? allowed: --bare, --check, --cluster, "),
        (["chaos", "--x=5"], "unknown option '--x=5'; allowed: --bare, --check, "),
        (["chaos", "double"], "'double' after 'chaos'; allowed: one study"),
        (["chaos", "--out"], "argument --out: expected one argument"),
        (["chaos", "--jobs", "x"], "--jobs is 'x'; allowed: a whole number"),
        (["chaos", "--jobs", "1.5"], "--jobs is '1.5'; allowed: a whole number"),
        (["chaos", "--jobs", "0"], "--jobs is 0; allowed: 1 to 1024"),
        (["chaos", "--jobs", "-3"], "--jobs is -3; allowed: 1 to 1024"),
        (["chaos", "--jobs", "1000000"], "--jobs is 1000000; allowed: 1 to 1024"),
        (
            ["chaos", "--engines", "nosuch"],
            "--engines: unknown engine 'nosuch'; allowed: analytic, ",
        ),
        (["chaos", "--engines", "mujoco,pymonk"], "--engines: unknown engine 'pymonk'; did you mean 'pymunk'?"),
        (["chaos", "--engines", ""], "--engines is ''; allowed: names of engines, separated by commas"),
        (["chaos", "--engines", " , "], "--engines is ' , '; allowed: names of engines, separated by commas"),
        (["chaos", "--scenes", ","], "--scenes is ','; allowed: names of scenes and files, separated by commas"),
        (["chaos", "--scenes", "double,nosuch.toml"], "--scenes, entry 2: nosuch.toml: no such file"),
        (["chaos", "--scenes", "doubel"], "--scenes, entry 1: unknown scene 'doubel'; did you mean 'double'?"),
        (["chaos", "--scenes", "double,double"], "--scenes has 'double' twice; allowed: each name once"),
        (["chaos", "--scenes", "double", "--check"], "--check is about the study's own scenes; allowed: without --sc"),
        (["chaos", "--scenes", "double", "--update-baseline"], "--update-baseline is about the study's own scenes"),
        (["arm.xml"], "arm.xml: this is a model, not a study; to study it: pendbench judge arm.xml, or pe"),
        (["chaoz"], "unknown study 'chaoz'; did you mean 'chaos'? allowed: "),
        ([""], "unknown study ''; allowed: "),
        (["nosuch.toml"], "nosuch.toml: no such file"),
        (["nosuch/"], "nosuch: no such file"),
        (["."], "unknown study '.'; allowed: "),
        (["./"], ".: a folder, not a file"),
        (["two\nlines.toml"], "two\\nlines.toml: no such file"),
        (["a\0b.toml"], "a\\x00b.toml: not a path"),
        (["\udcff.toml"], "\\udcff.toml: no such file"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert refused(capsys, *arguments).startswith(said)
    assert files(tmp_path) == set()


def test_a_folder_that_cannot_be_written_is_one_line(study, capsys):
    folder = study.parent
    before = files(folder)
    for out in (study, study / "results"):
        expected = f"--out {out}: is or lies below a file; allowed: a folder that can be written"
        assert refused(capsys, study, "--out", out) == expected
    assert refused(capsys, study, "--out", "") == "--out is empty; allowed: a folder"
    long = folder / ("x" * 300)
    assert "File name too long; allowed: a folder that can be written" in refused(capsys, study, "--out", long)
    assert files(folder) == before


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="who may write everywhere is refused nowhere")
def test_a_read_only_folder_is_one_line(study, capsys):
    folder = study.parent / "closed"
    folder.mkdir(mode=0o500)
    assert refused(capsys, study, "--out", folder).startswith(f"--out {folder}: not writable; allowed: a folder that")
    assert refused(capsys, study, "--out", folder / "results").startswith(f"--out {folder / 'results'}: ")


def test_a_wrong_study_file_is_one_line_and_writes_nothing(study, capsys):
    before = files(study.parent)
    study.write_text(study.read_text().replace("rk4", "rk5"))
    message = refused(capsys, study, "--out", study.parent / "out")
    assert message.startswith(f"{study} [engines number 2]: unknown method 'rk5'; did you mean 'rk4'? allowed: ")
    assert files(study.parent) == before


def test_an_error_of_the_disk_is_one_line(study, capsys, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(api, "LocalPool", Inline)
    monkeypatch.setattr(api.Store, "save", full)
    code = command_line.main([str(study), "--out", str(study.parent / "out")])
    last = capsys.readouterr().err.splitlines()[-1]
    assert (code, last) == (2, "error: [Errno 28] No space left on device; what was finished is kept")


def test_as_typed_into_a_shell():
    ran = subprocess.run([*LINE, "chaos", "--jobs", "x"], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr == "error: --jobs is 'x'; allowed: a whole number\n"


def test_a_terminal_that_knows_few_letters_shows_the_others_as_escapes():
    few = {**os.environ, "PYTHONIOENCODING": "ascii"}
    code = (
        "from pendbench.commands import shell, study as line\n"
        "line.main(['--list']); shell.say('3 µs'); line.main(['ö'])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=few)
    assert ran.stdout.splitlines()[-1] == "3 \\xb5s"
    assert ran.stderr.startswith("error: unknown study '\\xf6'; ")


# What a study leaves.


def test_a_study_by_default_goes_to_results(study, monkeypatch, capsys):
    monkeypatch.chdir(study.parent)
    monkeypatch.setattr(api, "LocalPool", Idle)
    with pytest.raises(AssertionError, match="asked to run"):
        command_line.main(["tiny.toml"])
    assert (study.parent / "results" / "tiny").is_dir()
    assert "what engines refuse: " in capsys.readouterr().err


def test_a_study_of_other_scenes_has_a_folder_of_its_own(study, monkeypatch, capsys):
    monkeypatch.chdir(study.parent)
    monkeypatch.setattr(api, "LocalPool", Idle)
    scene = (study.parent / "double.toml").rename(study.parent / "arm.toml")
    with pytest.raises(AssertionError, match="asked to run"):
        command_line.main(["tiny.toml", "--scenes", scene.name])
    assert (study.parent / "results" / "tiny-arm").is_dir()
    with pytest.raises(AssertionError, match="asked to run"):
        pb.run_study("tiny.toml", scenes=pb.load_scene("double").with_(name="../an arm"))
    assert (study.parent / "results" / "tiny-_an_arm").is_dir()
    assert "what engines refuse: " in capsys.readouterr().err


def test_results_that_an_earlier_run_left_for_nothing_are_told(tmp_path):
    def told(**kept):
        report = Report(Results("made", "Made up", "chaos", None, **kept))
        return [*command._unused(api.Finished(report, tmp_path))]

    assert told(kept=(2, 5)) == []
    [line] = told(unused=3)
    assert line.startswith(f"Not used: 3 results in {tmp_path / 'work'}, of another study, or of another version")


def test_options_reach_the_study(study, monkeypatch):
    asked = []

    def run_request(request, watcher):  # noqa: ARG001
        asked.append(request)
        raise KeyboardInterrupt

    monkeypatch.setattr(api, "run_request", run_request)
    options = ["--quick", "--engines", "mujoco, pymunk", "--jobs", "3", "--check", "--fresh", "--update-baseline"]
    assert command_line.main([str(study), "--out", "there", *options]) == 130
    assert asked == [
        api.Request(
            str(study), Path("there"), quick=True, engines=("mujoco", "pymunk"), jobs=3, check=True, fresh=True,
            update_baseline=True,
        )
    ]  # fmt: skip
    command_line.main(["chaos"])
    assert asked[1] == api.Request("chaos")
    command_line.main(["chaos", "--scenes", "double, arm.toml"])
    assert asked[2] == api.Request("chaos", scenes=("double", "arm.toml"))


def test_run_study_is_the_same_from_python(study, monkeypatch, tmp_path):
    from pendbench import InputError, run_study

    asked = []
    monkeypatch.setattr(api, "run_request", lambda request: asked.append(request) or 1 / 0)
    for engines in ("mujoco", ["mujoco"], ("mujoco",)):
        with pytest.raises(ZeroDivisionError):
            run_study(study, tmp_path / "out", engines=engines, jobs=2)
    assert set(map(repr, asked)) == {repr(api.Request(study, tmp_path / "out", engines=("mujoco",), jobs=2))}
    monkeypatch.undo()
    for scenes in ("double", ["double"], pb.load_scene("double")):
        monkeypatch.setattr(api, "run_request", lambda request: asked.append(request) or 1 / 0)
        with pytest.raises(ZeroDivisionError):
            run_study(study, scenes=scenes)
        assert getattr(asked[-1].scenes[0], "name", asked[-1].scenes[0]) == "double"
        monkeypatch.undo()
    for wrong in ({"jobs": 0}, {"jobs": 1.5}, {"jobs": "2"}, {"jobs": True}, {"engines": ["x"]}):
        with pytest.raises(InputError, match="; allowed: "):
            run_study(study, tmp_path / "out", **wrong)
    with pytest.raises(InputError, match="--out 5: not a path; allowed: "):
        run_study(study, 5)
    assert not (tmp_path / "out").exists()


# Ctrl-C.


def started(study: Path, out: Path, **environment: str) -> subprocess.Popen:
    return subprocess.Popen(
        [*LINE, str(study), "--out", str(out), "--jobs", "2"],
        start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, **environment}, preexec_fn=_hear_interrupts,  # noqa: PLW1509
    )  # fmt: skip


def _hear_interrupts() -> None:
    """A shell has its background processes ignore them, and these would pass that on."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def assert_stopped(process: subprocess.Popen, code: int = 130) -> None:
    """It ended as an interrupted program should, without a traceback, and left no process behind."""
    try:
        out, err = process.communicate(timeout=400)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    assert process.returncode == code, err
    assert out == ""
    assert code != 130 or err.splitlines()[-1].startswith("stopped; what was finished is kept")
    assert "Traceback" not in err
    assert "KeyboardInterrupt" not in err
    for _ in range(30_000):
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.01)
    raise AssertionError("some of its processes are still there")


@pytest.mark.parametrize(("code", "said"), [(130, "tidied\n"), (0, "tidied\nlate\n")])
def test_an_interrupted_process_tidies_up_and_takes_nothing_apart(code, said):
    script = f"""
import atexit
from pendbench.commands.shell import leave
class Late:
    def __del__(self):
        print("late")
kept = Late()
atexit.register(print, "tidied")
leave({code})
"""
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (code, said, "")


def test_ctrl_c_while_workers_are_starting(study, tmp_path):
    process = started(study, tmp_path / "out")
    process.stderr.readline()  # the first stage has begun: so have the workers
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    assert_stopped(process)


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_stop_in_the_middle_does_not_wait_for_jobs_and_keeps_what_is_done(tmp_path, sent, code):
    install(tmp_path)
    tables = "".join(
        f'[[engines]]\nname = "{name}"\nmethods = ["rk4"]\ndt = [1e-2]\n' for name in ("analytic", "hanging")
    )
    head = 'title = "T"\nscenes = ["double.toml"]\nstarts = 2\nlyapunov_time = 5\ntime_limit = 80000\n'
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    work = tmp_path / "out" / "work"
    process = started(write_study(tmp_path, tables, head), tmp_path / "out", PYTHONPATH=path)
    with process.stderr:
        for line in process.stderr:
            if line.startswith("the engines"):
                break
        before = len(list(work.glob("*.json")))
        while process.poll() is None and len(list(work.glob("*.json"))) < before + 3:  # what does not hang has finished
            time.sleep(0.01)
        assert process.poll() is None, process.stderr.read()
        os.kill(process.pid, sent)
        assert_stopped(process, code)
    assert len(list(work.glob("*.json"))) == before + 3
    assert not (tmp_path / "out" / "cases.csv").exists()


@pytest.mark.parametrize("name", sorted({*pb.__all__} - {"reference"}))
def test_the_help_of_a_public_name_names_no_constant(name):
    """Someone who reads help() sees no module: numbers belong there."""
    text = inspect.getdoc(getattr(pb, name)) or ""
    assert text
    assert not re.search(r"`_?[A-Z][A-Z_]+`", text)
