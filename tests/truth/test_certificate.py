"""Certificates: whole or refused, checked by another way, and the bundled ones are of their scenes."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
from fractions import Fraction

import numpy as np
import pytest

from pendbench.__main__ import main
from pendbench.base.bundled import bundled, bundled_names
from pendbench.base.errors import InputError
from pendbench.commands import prove as prove_command
from pendbench.physics.geometry import distance
from pendbench.scene.scene import load_scene
from pendbench.truth.proof.certificate import _digest, check_doubles, read_proof
from pendbench.truth.proof.check import check_proof
from pendbench.truth.proof.known import proven
from pendbench.truth.proof.proof import prove, prove_at
from pendbench.truth.reference import reference

with_flint = pytest.mark.skipif("not __import__('importlib').util.find_spec('flint')", reason="needs the extra `proof`")
TIMES = [0.0, 0.25, 0.5]


@pytest.fixture(scope="module")
def proof():
    pytest.importorskip("flint", reason="the extra `proof` is not installed")
    return prove("single", times=TIMES)


@pytest.fixture
def file(proof, tmp_path):
    return proof.save(tmp_path / "single.npz")


def test_what_is_written_is_read_and_agrees_with_the_other_way(proof, file):
    again = read_proof(file, load_scene("single"))
    for field in ("t", "theta_mid", "theta_rad", "omega_mid", "omega_rad", "balls"):
        assert np.array_equal(getattr(again, field), getattr(proof, field))
    assert again.made == proof.made
    assert again.until == 0.5
    assert 0 < again.sharpest < 1e-40 < again.error < 2.0**-52  # half a unit in the last place of 1.5
    found = check_proof(again)
    assert found.agreed == found.looked_at == 3
    assert not found.reason
    assert "momenta" in found.how
    with pytest.raises(InputError, match="says nothing of times until -1 s"):
        check_proof(again, -1.0)


def test_names_are_those_that_others_rely_on(file):
    with np.load(file) as held:
        assert set(held) >= {"times", "theta_mid", "theta_rad", "omega_mid", "omega_rad"}
        about = json.loads(str(held["about"]))
    assert about["scene_file"] == load_scene("single").to_toml()
    assert {"bits", "order", "flint", "python-flint", "seconds"} <= set(about["made"])


def changed(file, name, change):
    """The same certificate with one array changed, its digest as it was."""
    with np.load(file) as held:
        arrays = {key: held[key] for key in held}
    arrays[name] = change(arrays[name])
    np.savez_compressed(file, **arrays)


def flipped(array):
    content = bytearray(array.tobytes())
    content[-8] ^= 1
    return np.frombuffer(bytes(content), array.dtype).reshape(array.shape)


@pytest.mark.parametrize("name", ["times", "theta_mid", "theta_rad", "omega_mid", "omega_rad", "balls", "about"])
def test_a_bit_that_changed_is_refused(file, name):
    changed(file, name, flipped)
    with pytest.raises(InputError, match=r"has been changed|no certificate"):
        read_proof(file, load_scene("single"))


def forged(path, about=lambda _: None, **arrays):
    """A bundled certificate with something changed and a digest that is right again."""
    with np.load(bundled("truths") / "single.npz") as held:
        kept = {key: held[key] for key in held} | arrays
    said = json.loads(str(kept["about"]))
    about(said)
    kept["about"] = np.array(json.dumps(said))
    kept["digest"] = np.array(_digest(kept["about"], kept))
    np.savez(path, **kept)
    return path


def backwards():
    with np.load(bundled("truths") / "single.npz") as held:
        return held["times"][::-1].copy()


@pytest.mark.parametrize(
    "wrong",
    [
        {"about": lambda said: said["made"].pop("bits")},
        {"about": lambda said: said["made"].update(bits=10**12)},  # takes all memory where it is believed
        {"about": lambda said: said["made"].update(order="high")},
        {"about": lambda said: said.update(made="by hand")},
        {"about": lambda said: said.update(ended=5)},
        {"times": np.array([0.0, np.nan])},
        {"times": backwards()},  # is never done where it is believed
        {"theta_mid": np.array("none")},
        {"balls": np.array([b"\xff"])},
    ],
)
def test_a_certificate_that_someone_made_up_is_refused_before_it_is_gone_by(wrong, tmp_path):
    read_proof(forged(tmp_path / "as_it_was.npz"), load_scene("single"))
    with pytest.raises(InputError, match=r"do not fit each other|not whole"):
        read_proof(forged(tmp_path / "forged.npz", **wrong), load_scene("single"))


def test_a_bit_of_the_file_itself_is_refused(file):
    content = file.read_bytes()
    for place in range(40, len(content), len(content) // 25):
        file.write_bytes(content[:place] + bytes([content[place] ^ 16]) + content[place + 1 :])
        try:
            read_proof(file, load_scene("single"))
        except InputError:
            continue
        with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(file) as now:
            # A bit that nobody reads, such as a time stamp.
            assert [whole.read(name) for name in whole.namelist()] == [now.read(name) for name in now.namelist()]


@pytest.mark.parametrize("content", [b"", b"PK", b"no certificate"])
def test_what_is_no_certificate_is_refused(tmp_path, content):
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(InputError, match="no certificate"):
        read_proof(tmp_path / "a.npz", load_scene("single"))
    with pytest.raises(InputError, match="no such file"):
        read_proof(tmp_path / "b.npz", load_scene("single"))


def test_another_scene_is_refused_and_another_duration_is_not(file):
    with pytest.raises(InputError, match="another scene"):
        read_proof(file, load_scene("double"))
    with pytest.raises(InputError, match="another scene"):
        read_proof(file, load_scene("single").with_(gravity=9.8))
    assert read_proof(file, load_scene("a01")).until == 0.5


def moved(text, by):
    m, e, r, f = (int(part, 16) for part in text.split(":"))
    return f"{round(Fraction(m) + Fraction(by) * Fraction(2) ** -e):x}:{e:x}:{r:x}:{f:x}"


def test_a_proof_of_something_false_is_found_out(proof):
    """Whole, and all its balls a little off."""
    texts = [[moved(text, 1e-30) for text in row] for row in proof.balls.tolist()]
    wider = {name: getattr(proof, name) + 1e-20 for name in ("theta_rad", "omega_rad")}
    found = check_proof(dataclasses.replace(proof, balls=np.array(texts), **wider))
    assert found.agreed == 1  # the start, whose whole numbers are too coarse to be moved by so little
    assert found.first_apart == 0.25


def test_doubles_that_do_not_hold_their_balls_are_found_out(proof):
    for field in ("theta_rad", "omega_rad"):
        with pytest.raises(InputError, match="do not hold"):
            check_doubles(dataclasses.replace(proof, **{field: getattr(proof, field) / 2}))
    with pytest.raises(InputError, match="arrays"):
        check_doubles(dataclasses.replace(proof, theta_rad=proof.theta_rad[1:]))


@with_flint
def test_it_goes_on_where_it_was(tmp_path):
    keep, scene = tmp_path / "kept", load_scene("single")
    stopped = prove_at(scene, TIMES, keep, within=1e-9)
    assert "time limit" in stopped.reason
    assert stopped.until < 0.5
    nothing = prove_at(scene, [0.5], within=1e-9)
    assert nothing.until == 0.0
    assert nothing.balls.shape == (0, 2)
    check_doubles(nothing)
    again = prove_at(scene, TIMES, keep)
    whole = prove_at(scene, TIMES)
    assert not again.reason
    assert again.until == whole.until == 0.5
    assert again.made["steps"] >= whole.made["steps"]
    text = keep.read_text()
    keep.write_text(text.replace('"steps": ', '"steps": 1', 1))  # not what was written: begins anew
    assert prove_at(scene, TIMES, keep).made["steps"] == whole.made["steps"]


@with_flint
def test_it_ends_at_its_memory_limit_and_goes_on_with_a_higher_one(tmp_path, capsys):
    out, line = tmp_path / "a.npz", ["prove", "single", "--until", "0.5", "--out", str(tmp_path / "a.npz")]
    assert main([*line, "--memory", "1"]) == 0  # less than Python takes
    assert "memory limit" in capsys.readouterr().out
    assert (tmp_path / "a.npz.part").is_file()
    ended = read_proof(out, load_scene("single"))
    assert ended.until < 0.5
    assert main([*line, "--memory", "1e6"]) == 0
    again = read_proof(out, load_scene("single"))
    assert (again.until, again.reason) == (0.5, "")
    assert np.array_equal(again.balls[: len(ended.t)], ended.balls)  # goes on, and does not begin anew
    assert main(["prove", "single", "--check", str(out), "--memory", "1"]) == 0
    assert "The other way ends there: it ran into its memory limit" in capsys.readouterr().out


@with_flint
def test_without_a_limit_half_of_the_machines_memory_is_one(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(prove_command, "machine_memory", lambda: 2e6)  # less than twice what Python takes
    assert main(["prove", "single", "--until", "0.5", "--out", str(tmp_path / "a.npz")]) == 0
    assert "memory limit" in capsys.readouterr().out


@with_flint
def test_a_chain_that_stands_still_stays_there_and_one_that_stands_on_its_head_is_not_known_for_ever():
    rest = prove(load_scene("double").with_(angles=0.0), times=[1.0])
    assert np.all(np.abs(rest.theta_mid) + rest.theta_rad < 1e-40)
    head = prove(load_scene("single").with_(angles=float(np.pi)), times=[0.0, 1.0])
    assert head.sharpest < 1e-20
    assert head.theta_mid[1, 0] != head.theta_mid[0, 0]  # pi as a double is not the top


def test_quadratic_drag_is_refused_with_the_reason(capsys):
    pytest.importorskip("flint", reason="the extra `proof` is not installed")
    with pytest.raises(InputError, match="not smooth"):
        prove("drag_chain10", times=[1.0])
    assert main(["prove", "drag_chain10"]) == 2
    assert "not smooth" in capsys.readouterr().err
    with pytest.raises(InputError, match="has 1000 links"):
        prove("chain1000")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"until": "soon"}, "until is 'soon'; allowed: a number from"),
        ({"until": 0.0}, "until is 0.0; allowed: a number from"),
        ({"until": 1.0, "times": [1.0]}, "until and times are given; allowed: one of them"),
    ],
)
def test_times_that_are_none_are_one_line(given, said):
    with pytest.raises(InputError, match=said):
        prove("single", **given)


def test_without_the_extra_one_line_says_how_to_get_it(monkeypatch, capsys):
    monkeypatch.setattr("importlib.util.find_spec", lambda *_: None)
    assert main(["prove", "double"]) == 2
    assert capsys.readouterr().err.count("pendbench[proof]") == 1


@with_flint
def test_the_command_proves_and_checks(tmp_path, capsys):
    out = str(tmp_path / "a.npz")
    assert main(["prove", "single", "--until", "0.1", "--out", out]) == 0
    assert "Proved until 0.1 s" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]
    assert main(["prove", "single", "--check", out, "--until", "0.01"]) == 0
    assert "101 of 101 times agree" in capsys.readouterr().out
    assert main(["prove", "double", "--check", out]) == 2
    for wrong in (["--out", "a.npz", "--check", out], ["--out", str(tmp_path)], ["--out", f"{out}/b.npz"]):
        assert main(["prove", "single", *wrong]) == 2
    for wrong in (["--out", "a.csv"], ["--out", ""], ["--until", "-1"], ["--within", "0"], ["--memory", "0.5"]):
        assert main(["prove", "single", *wrong]) == 2


def scenes_with_certificates():
    return [name for name in bundled_names("models") if (bundled("truths") / f"{name}.npz").is_file()]


def whole_number_distance(text, high, low):
    """How far a double-double is from a ball's farthest point, exactly: with python's own whole numbers."""
    m, e, r, f = (int(part, 16) for part in text.split(":"))
    off = Fraction(high) + Fraction(low) - m * Fraction(2) ** e
    return float(abs(off) + r * Fraction(2) ** f) * (1 if off >= 0 else -1)


@pytest.mark.parametrize("name", scenes_with_certificates())
def test_the_reference_is_as_near_as_it_claims(name):
    scene = load_scene(name)
    held = read_proof(bundled("truths") / f"{name}.npz", scene)
    near = np.flatnonzero((held.t > 0.0) & (held.t <= 8.0))
    few = near[:: max(len(near) // 10, 1)].tolist()
    truth = reference(scene, held.t[few])
    for i, k in enumerate(few[: len(truth.t)]):
        lows = zip(held.balls[k], truth.theta[i].tolist(), truth.theta_low[i].tolist(), strict=False)
        off = np.array([whole_number_distance(*its) for its in lows])
        assert distance(scene.lengths, truth.theta[i], off) <= truth.bound[i]


def test_what_is_proved_is_that_of_a_scene_s_own_motion():
    double = load_scene("double")
    found = proven([double, load_scene("rope500"), double.with_(gravity=9.8)])
    assert [its.scene for its in found] == ["double"]
    assert found[0].until == 30.0
    assert 1e-60 < found[0].error < 1e-20
