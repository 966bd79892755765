"""Model files that cannot be used: one line that names the file, nothing run and nothing read outside its folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

from pendbench import load_scene
from pendbench.base.errors import InputError
from pendbench.scene.models.read import read_model

# A rod of 1 m, and a sphere that weighs nothing.
LINK = """<body pos="0 0 {z}"><joint axis="0 -1 0" {joint}/>
<inertial pos="0 0 -.5" mass="1" diaginertia=".08333333333333333 .08333333333333333 .1"/>
<geom type="sphere" size=".1" pos="0 0 -1" mass="0" {geom}/>{rest}</body>"""


def link(rest="", z="0", joint="", geom='contype="0" conaffinity="0"'):
    return LINK.format(z=z, joint=joint, geom=geom, rest=rest)


def mjcf(body, beside="", option=""):
    return f"<mujoco><option {option}/><worldbody>{body}</worldbody>{beside}</mujoco>"


def refusal(folder, text, name="model.xml"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        load_scene(path)
    line = str(error.value)
    assert line.isprintable()
    assert len(line) <= 400
    assert str(path)[-40:] in line
    return line


def notes(folder, text):
    path = folder / "model.xml"
    path.write_text(text)
    return read_model(path).notes


BOMB = '<!DOCTYPE m [<!ENTITY a "aaaa">' + "".join(
    f'<!ENTITY {b} "&{a};&{a};&{a};&{a};&{a};&{a};&{a};&{a};">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
FIXED = '<joint name="j{i}" type="fixed"><parent link="a"/><child link="b"/></joint>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "not XML: no element found"),
        (b"\x00\xff\xfe", "not XML: syntax error (at line 1, column 1)"),
        ("duration = 1.0", "not XML"),
        ("<mujoco><worldbody></mujoco>", "not XML: mismatched tag (at line 1, column "),
        ("<mujoco>" * 3000, "nested deeper than 2000"),
        ("<svg/>", "its root is <svg>; allowed: <mujoco> (MJCF) or <robot> (URDF)"),
        (BOMB + "]><mujoco><worldbody>&i;</worldbody></mujoco>", "it declares a document type or entities"),
        ('<!DOCTYPE m SYSTEM "file:///etc/passwd"><mujoco/>', "it declares a document type or entities"),
        ("<mujoco><bodies/></mujoco>", "MuJoCo does not compile it: XML Error: Schema violation"),
        (mjcf("<body><joint/></body>"), "MuJoCo does not compile it: "),
        (mjcf(link()).replace('size=".1"', 'size="x"'), "MuJoCo does not compile it: "),
        ("<mujoco/>", "nothing in it moves: it has no joint"),
        (mjcf("<body><freejoint/><geom size='1'/></body>"), "is a free joint; allowed: one chain of hinges"),
        (mjcf("<body name='a'><joint name='s' type='slide'/><geom size='1'/></body>"), "joint 's' is a slide joint"),
        (mjcf("<body name='a'><joint type='ball'/><geom size='1'/></body>"), "the joint of body 'a' is a ball joint"),
        (mjcf(link() + link()), "2 chains begin at the world: body number 1, body number 2; allowed: one chain"),
        (mjcf(link(link(z="-1") + link(z="-1"))), "body number 1 branches into body number 2, body number 3"),
        (mjcf(link().replace("<geom", '<joint axis="0 1 0"/><geom')), "body number 1 has 2 joints; allowed: one"),
        (
            mjcf(link(link(z="-1").replace("0 -1 0", "0 -1 .1"))),
            "the axis of the joint of body number 2 is not",
        ),
        (mjcf(link(link(z="0"))), "the joint of body number 1 and the next one are at the same place"),
        (mjcf(link(link(z="-1")).replace("0 0 -.5", ".3 0 -.5", 1)), "is 0.3 m beside the line from its joint to the"),
        (mjcf(link(joint='frictionloss="0.1"')), "friction loss of joints: no scene has these yet"),
        (mjcf(link(joint='stiffness="1 2 3"')), "springs that are not linear"),
        (mjcf(link(joint='damping="1 2 3"')), "damping that is not linear"),
        (mjcf(link(), option='viscosity="1e-3"'), "a fluid (option density or viscosity)"),
        (mjcf(link(), option='density="1.2" wind="1 0 0"'), "a fluid (option density or viscosity)"),
        (mjcf(link()).replace("<body ", '<body gravcomp="1" '), "gravity compensation"),
        (mjcf(f'<body mocap="true">{link()}</body>'), "a chain that hangs at a mocap body"),
        (
            mjcf(link(joint='name="j"'), "<equality><joint joint1='j'/></equality>"),
            "equality constraints: no scene has these yet",
        ),
        (
            mjcf(link(joint='name="j"'), "<actuator><position name='servo' joint='j' kp='2'/></actuator>"),
            "actuator 'servo' is in use: it pushes with its control at 0",
        ),
        (
            mjcf(link(joint='name="j"'), "<actuator><motor joint='j' ctrlrange='1 2'/></actuator>"),
            "actuator number 1 is in use",
        ),
        (
            mjcf(link(joint='name="j"'), "<actuator><motor joint='j'/></actuator><keyframe><key ctrl='2'/></keyframe>"),
            "actuator number 1 is in use: it pushes with its control at what the keyframe says",
        ),
        (
            mjcf(
                link(joint='name="j"'),
                "<tendon><fixed name='t' stiffness='1'><joint joint='j' coef='1'/></fixed></tendon>",
            ),
            "tendon 't' pulls at the chain",
        ),
        (mjcf(link(), "<extension><plugin plugin='mujoco.pid'/></extension>"), "a plugin is a program"),
        (mjcf(link(), "<include file='absent.xml'/>"), "it includes 'absent.xml', and there is no such file"),
        (mjcf(link(), "<include file='../other.xml'/>"), "include '../other.xml' is not in the model's own folder"),
        (mjcf(link(), "<include file='/etc/passwd'/>"), "include '/etc/passwd' is not in the model's own folder"),
        (mjcf(link(), "<asset><mesh file='absent.stl'/></asset>"), "MuJoCo does not compile it: "),
        (mjcf(link(), "<asset><mesh file='../a.stl'/></asset>"), "mesh '../a.stl' is not in the model's own folder"),
        (mjcf(link(), "<asset><texture type='2d' file='/a.png'/></asset>"), "texture '/a.png' is not in the model's"),
        (mjcf(link(), "<asset><model file='../a.xml'/></asset>"), "model '../a.xml' is not in the model's own folder"),
        (
            mjcf(link(), "<compiler meshdir='../..'/><asset><mesh file='a.stl'/></asset>"),
            "mesh '../..' is not in the model's own folder",
        ),
        (mjcf(f'<replicate count="100000000">{link()}</replicate>'), "it asks for more than 10000 elements"),
        (
            mjcf("<replicate count='1000'>" * 3 + link() + "</replicate>" * 3),
            "it asks for more than 10000 elements",
        ),
        (mjcf(link() + '<composite type="grid" count="9999 9999 1" spacing="1"/>'), "it asks for more than 10000"),
        (mjcf(link(), '<size memory="1000T"/>'), "<size memory> is '1000T'; allowed: at most 1G"),
        (mjcf(link(), '<size nuserdata="100000000"/>'), "<size nuserdata> is '100000000'; allowed: at most 10000"),
        (
            mjcf(link(), "<asset><texture type='2d' builtin='flat' width='99999' height='99999'/></asset>"),
            "<texture> asks for width x height above",
        ),
        (
            mjcf(link(), "<asset><mesh name='m' builtin='supersphere' params='99999 99999 1 1'/></asset>"),
            "<mesh> asks for params above",
        ),
        (mjcf(link(), "<custom><numeric name='m' size='100000000'/></custom>"), "<numeric size> is '100000000'"),
        (mjcf(link(), "<sensor><user dim='100000000'/></sensor>"), "<user> asks for dim above 10000"),
    ],
)
def test_what_is_refused_and_why(tmp_path, text, words):
    assert words in refusal(tmp_path, text)


@pytest.mark.parametrize("name", ["damping", "stiffness", "springref", "armature"])
def test_numbers_that_are_not_finite_are_one_line(tmp_path, name):
    assert ": " in refusal(tmp_path, mjcf(link(joint=f'{name}="1e308"')).replace('mass="1"', 'mass="1e300"'))


def test_contacts_and_limits_are_refused_where_a_run_of_the_file_reaches_them(tmp_path):
    hits = mjcf("<geom name='floor' type='plane' size='5 5 1' pos='0 0 -.5'/>" + link(geom="name='ball'"))
    line = refusal(tmp_path, hits)
    assert re.search(
        r"(geom 'floor' touches geom 'ball'|geom 'ball' touches geom 'floor') 0\.\d+ s after the start", line
    )
    limited = link(joint='name="elbow" range="-10 10"')
    thrown = mjcf(limited, "<keyframe><key qvel='2'/></keyframe>")
    assert "joint 'elbow' comes to its limit 0." in refusal(tmp_path, thrown)
    still = notes(tmp_path, mjcf(limited, "<keyframe><key qvel='.1'/></keyframe>"))
    assert still[0] == "contacts and limits: left out, none is reached in 10 s of a run of the file as it stands"
    assert not notes(tmp_path, thrown.replace("<option />", "<option><flag constraint='disable'/></option>"))[
        0
    ].startswith("contacts")


def test_everything_that_is_left_out_is_said(tmp_path):
    chain = link(link(z="-1", joint='name="b"') + '<site name="s"/><camera/><light/><body/>', joint='name="a"')
    beside = (
        "<actuator><motor joint='a'/><motor joint='b'/></actuator><sensor><jointpos joint='a'/></sensor>"
        "<tendon><fixed><joint joint='b' coef='1'/></fixed></tendon><asset><material name='m'/></asset>"
        "<equality><joint joint1='a' active='false'/></equality><keyframe><key/><key/><key/></keyframe>"
    )
    found = notes(
        tmp_path, mjcf("<light/><body/><body/>" + chain, beside).replace("</body></body>", "<body/></body></body>")
    )
    said = "\n".join(found)
    for words in ("2 lights: left out", "1 camera: left out", "1 site: left out", "1 sensor: left out",
                  "1 material: left out", "2 actuators: left out", "1 tendon: left out", "1 equality constraint: left",
                  "2 geoms: left out but for what they weigh", "2 bodies that cannot move: left out",
                  "1 body without a joint: merged into the links", "2 other keyframes: left out"):  # fmt: skip
        assert words in said
    assert len(found) == 12


def test_what_the_file_switches_off_is_left_out_and_said(tmp_path):
    text = mjcf(link(joint='stiffness="1" damping="1" frictionloss="1"'))
    off = "<option><flag spring='disable' damper='disable' gravity='disable' frictionloss='disable'/></option>"
    found = "\n".join(notes(tmp_path, text.replace("<option />", off)))
    for name in ("spring", "damper", "gravity"):
        assert f"{name}: left out, the file disables it" in found
    assert "friction loss: left out, the file has it off" in found
    assert load_scene(tmp_path / "model.xml").effects.named() == ("rod_mass",)


def test_included_files_in_the_folder_are_read_and_those_behind_a_link_are_not(tmp_path):
    inside, outside = tmp_path / "inside", tmp_path / "outside.xml"
    (inside / "parts").mkdir(parents=True)
    part = f"<mujoco><worldbody>{link()}</worldbody></mujoco>"
    (inside / "parts" / "link.xml").write_text(part)
    (inside / "model.xml").write_text("<mujoco><include file='parts/link.xml'/></mujoco>")
    assert load_scene(inside / "model.xml").n == 1
    outside.write_text(part)
    (inside / "parts" / "link.xml").unlink()
    (inside / "parts" / "link.xml").symlink_to(outside)
    with pytest.raises(InputError, match="is a link out of the model's own folder"):
        load_scene(inside / "model.xml")


def test_a_bomb_in_an_included_file_and_one_that_includes_itself(tmp_path):
    (tmp_path / "part.xml").write_text(
        f'<mujoco><worldbody><replicate count="99999">{link()}</replicate></worldbody></mujoco>'
    )
    assert "more than 10000 elements" in refusal(tmp_path, "<mujoco><include file='part.xml'/></mujoco>")
    assert "MuJoCo does not compile it" in refusal(tmp_path, "<mujoco><include file='model.xml'/></mujoco>")


def test_a_link_to_a_model_is_read_where_the_model_is(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "part.xml").write_text(f"<mujoco><worldbody>{link()}</worldbody></mujoco>")
    (tmp_path / "there" / "model.xml").write_text("<mujoco><include file='part.xml'/></mujoco>")
    (tmp_path / "model.xml").symlink_to(tmp_path / "there" / "model.xml")
    assert load_scene(tmp_path / "model.xml").n == 1
    with pytest.raises(InputError, match="not a path"):
        load_scene("no\0path.xml")


def test_models_that_are_attached_again_and_again(tmp_path):
    (tmp_path / "part.xml").write_text(mjcf(link() * 100))
    asset = "<asset><model name='part' file='part.xml'/></asset>"
    frames = "<replicate count='999'><attach model='part' body='b' prefix='p'/></replicate>"
    assert "more than 10000 elements" in refusal(tmp_path, mjcf(frames, asset))
    (tmp_path / "part.xml").write_text(mjcf("<attach model='other' body='b' prefix='p'/>"))
    assert "it attaches a model that attaches others" in refusal(tmp_path, mjcf("", asset))


def test_a_picture_that_would_fill_the_memory(tmp_path):
    (tmp_path / "big.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + b"\x00\x01\x00\x00" * 2)
    picture = mjcf(link(), "<asset><texture type='2d' file='big.png'/></asset>")
    assert "texture 'big.png' is larger than" in refusal(tmp_path, picture)


def test_a_pipe_is_never_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe.xml")
    assert "'pipe.xml' is not a regular file" in refusal(tmp_path, "<mujoco><include file='pipe.xml'/></mujoco>")
    with pytest.raises(InputError, match="not a regular file"):
        load_scene(tmp_path / "pipe.xml")


URDF = """<robot name="arm"><link name="base"/>{links}{joints}</robot>"""
URDF_LINK = """<link name="{name}"><inertial><origin xyz="0 0 -0.2"/><mass value="1"/>
<inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>{more}</link>"""
URDF_JOINT = """<joint name="{name}" type="{kind}"><parent link="{a}"/><child link="{b}"/><origin xyz="0 0 -0.4"/>
<axis xyz="0 1 0"/>{more}</joint>"""


def test_a_urdf_is_refused_for_the_same_reasons(tmp_path):
    one = URDF.format(links=URDF_LINK.format(name="a", more=""), joints=URDF_JOINT)
    made = {"name": "j", "a": "base", "b": "a", "more": "", "kind": "floating"}
    assert "joint 'j' is a free joint" in refusal(tmp_path, one.format(**made), "arm.urdf")
    rubbing = {**made, "kind": "continuous", "more": '<dynamics damping="0.1" friction="0.2"/>'}
    assert "friction loss" in refusal(tmp_path, one.format(**rubbing), "arm.urdf")
    mesh = '<collision><geometry><mesh filename="package://arm/../../etc/x.stl"/></geometry></collision>'
    absent = URDF.format(links=URDF_LINK.format(name="a", more=mesh), joints=URDF_JOINT)
    assert "MuJoCo does not compile it" in refusal(
        tmp_path, absent.format(**{**made, "kind": "continuous"}), "arm.urdf"
    )


def test_no_traceback_and_exit_code_2(tmp_path):
    (tmp_path / "bad.xml").write_text(mjcf("<body><freejoint/><geom size='1'/></body>"))
    (tmp_path / "study.toml").write_text(
        'title = "t"\nkind = "chaos"\nscenes = ["bad.xml"]\n'
        '[[engines]]\nname = "mujoco"\nmethods = ["rk4"]\ndt = [1e-3]\n'
    )
    command = [sys.executable, "-m", "pendbench.study", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out")]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert ran.returncode == 2
    assert "Traceback" not in ran.stderr
    assert "bad.xml: the joint of body number 1 is a free joint; allowed: one chain of hinges" in ran.stderr
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_a_folder_an_absent_file_and_an_odd_name(tmp_path):
    (tmp_path / "folder.xml").mkdir()
    for name, words in (("folder.xml", "a folder, not a file"), ("absent.urdf", "no such file")):
        with pytest.raises(InputError, match=words):
            load_scene(tmp_path / name)
    odd = tmp_path / "dœ a\nb.xml"
    odd.write_text(mjcf(link()))
    assert load_scene(odd).name == "dœ a\\nb"
