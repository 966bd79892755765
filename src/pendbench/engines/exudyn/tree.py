"""A chain as Exudyn's kinematic tree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import exudyn
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

from pendbench.engines.joint_run import gravity_at, torques_in_joints, weights_in_joints
from pendbench.engines.joints import absolute_values, bodies, joint_values
from pendbench.engines.protocol import State
from pendbench.physics import acting
from pendbench.scene.scene import Scene


class Chain:
    """One chain, at its start."""

    def __init__(self, scene: Scene) -> None:
        self._container = exudyn.SystemContainer()
        self.mbs = self._container.AddSystem()
        self._add(scene)
        self.mbs.Assemble()

    def _add(self, scene: Scene) -> None:
        n, (masses, centres, inertias) = scene.n, bodies(scene)
        offsets = np.append(0.0, scene.lengths[:-1])
        node = self.mbs.AddNode(
            NodeGenericODE2(
                referenceCoordinates=[0.0] * n,
                initialCoordinates=joint_values(scene.angles).tolist(),
                initialCoordinates_t=joint_values(scene.rates).tolist(),
                numberOfODE2Coordinates=n,
            )
        )
        changing = acting.is_shaken(scene) or acting.is_pushed(scene)
        self.mbs.AddObject(
            ObjectKinematicTree(
                nodeNumber=node,
                jointTypes=[exudyn.JointType.RevoluteZ] * n,
                linkParents=list(range(-1, n - 1)),
                jointTransformations=exudyn.Matrix3DList([np.eye(3)] * n),
                jointOffsets=exudyn.Vector3DList([[0.0, -offset, 0.0] for offset in offsets.tolist()]),
                linkInertiasCOM=exudyn.Matrix3DList([inertia * np.eye(3) for inertia in inertias.tolist()]),
                linkCOMs=exudyn.Vector3DList([[0.0, -centre, 0.0] for centre in centres.tolist()]),
                linkMasses=masses.tolist(),
                gravity=[0.0, 0.0, 0.0] if changing else [*gravity_at(scene, 0.0), 0.0],
                **({"forceUserFunction": self._forces(scene)} if changing else {}),
            )
        )

    def _forces(self, scene: Scene) -> Callable[..., list[float]]:
        """The torques in the joints at each evaluation. It must not raise: Exudyn would print that and go on."""

        def forces(_: Any, t: float, __: int, q: Any, v: Any) -> list[float]:
            q, v = np.array(q), np.array(v)
            with np.errstate(all="ignore"):
                return list(weights_in_joints(scene, t, q) + torques_in_joints(scene, t, q, v))

        return forces

    def state(self) -> State:
        """The state now."""
        q, v = self.mbs.systemData.GetODE2Coordinates(), self.mbs.systemData.GetODE2Coordinates_t()
        with np.errstate(all="ignore"):
            return State(absolute_values(np.array(q)), absolute_values(np.array(v)))
