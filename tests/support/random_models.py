"""Chains as MJCF files with all that a file can say in more than one way: frames, axes, references, welded bodies."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation


def random_mjcf(seed: int, n: int) -> str:
    """A planar chain of n links in disorder, all numbers with all their digits.

    The links' centres lie on the line between their joints, but for the last one's. About half of the links are made
    of geoms, the others of inertias; some have bodies welded to them.
    """
    return _Writer(np.random.default_rng(seed), n).text()


_OF_JOINTS = {
    "ref": (-2.0, 2.0),
    "springref": (-2.0, 2.0),
    "damping": (0.0, 0.5),
    "stiffness": (0.0, 3.0),
    "armature": (0.0, 0.3),
}


class _Writer:
    def __init__(self, rng: np.random.Generator, n: int) -> None:
        self.rng, self.n = rng, n
        self.normal = self.unit()
        self.root = ET.Element("mujoco")
        ET.SubElement(self.root, "compiler", angle="radian")
        option = ET.SubElement(self.root, "option", gravity=say(rng.normal(size=3) * 6.0))
        ET.SubElement(option, "flag", contact="disable")

    def text(self) -> str:
        parent, turned, at = ET.SubElement(self.root, "worldbody"), Rotation.identity(), np.zeros(3)
        for _ in range(self.rng.integers(0, 3)):  # what the pivot hangs at
            parent, turned = self.body(parent, turned, at)
            at = self.rng.normal(size=3)
        for _ in range(self.n):
            parent, turned, at = self.link(parent, turned, at)
        key = ET.SubElement(self.root, "keyframe")
        ET.SubElement(
            key, "key", name="go", qpos=say(self.rng.normal(size=self.n)), qvel=say(self.rng.normal(size=self.n))
        )
        return ET.tostring(self.root, encoding="unicode")

    def body(self, parent: ET.Element, turned: Rotation, at: np.ndarray) -> tuple[ET.Element, Rotation]:
        """A body at a place from its parent along the world's axes, turned at random."""
        own = Rotation.random(random_state=self.rng)
        quaternion = (turned.inv() * own).as_quat(scalar_first=True)
        return ET.SubElement(parent, "body", pos=say(turned.inv().apply(at)), quat=say(quaternion)), own

    def link(self, parent: ET.Element, turned: Rotation, anchor: np.ndarray) -> tuple[ET.Element, Rotation, np.ndarray]:
        """A link whose joint is at an anchor; the next one's anchor, from the body's place along the world's axes."""
        hinge = self.rng.normal(size=3) * 0.2  # the joint's place from the body's
        body, own = self.body(parent, turned, anchor - hinge)
        self.joint(body, own, hinge)
        mass, moment = self.weigh(body, own)
        for _ in range(self.rng.integers(0, 3)):
            at = self.rng.normal(size=3) * 0.3
            welded, its = self.body(body, own, at)
            more, its_moment = self.weigh(welded, its)
            mass, moment = mass + more, moment + its_moment + more * at
        across = moment / mass - hinge
        across -= (across @ self.normal) * self.normal
        along = self.rng.choice([-0.7, 0.6, 1.0, 1.9]) * across + self.rng.normal() * 0.1 * self.normal
        return body, own, hinge + along

    def joint(self, body: ET.Element, own: Rotation, hinge: np.ndarray) -> None:
        sign, of_joint = self.rng.choice([-1.0, 1.0]), ET.SubElement(body, "joint")
        of_joint.set("pos", say(own.inv().apply(hinge)))
        of_joint.set("axis", say(own.inv().apply(sign * self.normal) * self.rng.uniform(0.5, 2.0)))
        for name, (low, high) in _OF_JOINTS.items():
            if self.rng.random() < 0.6:
                of_joint.set(name, say([self.rng.uniform(low, high)]))

    def weigh(self, body: ET.Element, own: Rotation) -> tuple[float, np.ndarray]:
        """Give a body its mass; return it, and mass times place from the body along the world's axes."""
        mass, at = self.rng.uniform(0.2, 2.0), self.rng.normal(size=3) * 0.3
        quaternion = say(Rotation.random(random_state=self.rng).as_quat(scalar_first=True))
        if self.rng.random() < 0.5:
            sizes = self.rng.uniform(0.05, 0.3, 3)
            kind = self.rng.choice(["box", "ellipsoid", "capsule"])
            ET.SubElement(body, "geom", type=kind, size=say(sizes), mass=say([mass]), pos=say(at), quat=quaternion)
        else:
            moments = np.diff([0.0, *np.sort(self.rng.uniform(0.01, 0.1, 2)), 0.1])  # of x^2, y^2 and z^2
            inertia = mass * (moments.sum() - moments)
            ET.SubElement(body, "inertial", mass=say([mass]), pos=say(at), quat=quaternion, diaginertia=say(inertia))
        return mass, mass * own.apply(at)

    def unit(self) -> np.ndarray:
        vector = self.rng.normal(size=3)
        return vector / np.linalg.norm(vector)


def say(numbers: object) -> str:
    return " ".join(repr(float(number)) for number in np.atleast_1d(numbers))
