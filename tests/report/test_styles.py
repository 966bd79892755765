"""The looks of engines: sixteen that can be told apart, by those who see few colours, too."""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib.colors import to_rgb

from pendbench.report.charts import Mark
from pendbench.report.plots import HUES, hue
from pendbench.report.styles import Styles, engine_hue, is_hollow
from pendbench.scene.scene import load_scene
from pendbench.study.case import Case

#: What is left of linear light for those who lack one kind of cone: Machado, Oliveira and Fernandes (2009), severity 1.
SIGHTS = {
    "all": np.eye(3),
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
KNOWN = ("analytic", "mujoco", "pymunk", "heyoka", "pinocchio", "newton", "drake", "exudyn", "dart", "mjx", "box2d",
         "rapier", "pybullet", "scipy", "xpbd")  # fmt: skip


def linear(colour):
    parts = np.array(to_rgb(colour))
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def lab(light):
    """CIE 1976 L*a*b*: distances of 2 are just seen."""
    xyz = XYZ @ np.clip(light, 0.0, 1.0) / np.array([0.95047, 1.0, 1.08883])
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_the_hues_can_be_told_apart_in_all_kinds_of_sight():
    for sight in SIGHTS.values():
        seen = [lab(np.asarray(sight) @ linear(hue(i))) for i in range(HUES)]
        assert min(np.linalg.norm(one - other) for one, other in itertools.combinations(seen, 2)) > 15.0


def test_the_hues_stand_out_from_white_and_from_the_dark_page():
    for ground in ("#ffffff", "#14171d"):
        for i in range(HUES):
            low, high = sorted(float(XYZ[1] @ linear(colour)) for colour in (hue(i), ground))
            assert (high + 0.05) / (low + 0.05) > 2.2


def test_no_two_known_engines_look_the_same():
    assert len({(engine_hue(name), is_hollow(name)) for name in KNOWN}) == len(KNOWN)
    assert not is_hollow("analytic")


def test_a_line_says_whose_it_is():
    scene = load_scene("single")
    cases = [
        Case(scene, "mujoco", "rk4", 1e-2),
        Case(scene, "mujoco", "rk4", 1e-3),
        Case(scene, "pybullet", "aba", 1e-3),
    ]
    styles = Styles.of_cases(cases)
    marks = [Mark.of(styles.line(case)["gid"]) for case in cases]
    assert [(mark.engine, mark.method, mark.step) for mark in marks] == [
        ("mujoco", "rk4", "step 0.01 s"), ("mujoco", "rk4", "step 0.001 s"), ("pybullet", "aba", "step 0.001 s"),
    ]  # fmt: skip
    assert marks[0].dashes != marks[1].dashes
    assert [mark.hollow for mark in marks] == [False, False, True]
    assert "path_effects" in styles.line(cases[2])
    assert Mark.of(styles.tag(cases[0], of_method=True)["gid"]).step == ""
