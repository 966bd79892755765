"""How a pivot can be driven in MuJoCo and pymunk, and which order of convergence each way keeps.

By hand: python benchmarks/driven_pivot.py. Ours is the gravity of the pivot's frame. The others: MuJoCo's pivot as a
body on a slide that a constraint ties to a target, or whose position and rate are overwritten; pymunk's as a kinematic
body with the velocity that takes it where it should be. All of these are set before each step.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np
import pymunk

import pendbench as pb
from pendbench.engines.mujoco.mjcf import alone
from pendbench.scene.scene import Effects, Scene

AMPLITUDE, FREQUENCY, END = 0.05, 8.0, 1.0
COUNTS = (250, 500, 1000, 2000)
SHAKEN = {"axis": "x", "amplitude": AMPLITUDE, "angular_frequency": FREQUENCY}
SCENE = Scene("shaken", "", END, [1.0, 0.7], [0.6, 0.5], [0.4, -0.3], [0.0, 0.0], Effects(9.81, driven_pivot=SHAKEN))

MODEL = """
<mujoco>
 <option gravity="0 0 -9.81" integrator="{integrator}" timestep="{dt}"/>
 <worldbody>
  <body name="target" mocap="true"/>
  <body name="base">
   <joint type="slide" axis="1 0 0"/>
   <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
   <body>
    <joint axis="0 -1 0"/>
    <inertial pos="0 0 -0.6" mass="1" diaginertia="1e-12 1e-12 1e-12"/>
    <body pos="0 0 -0.6">
     <joint axis="0 -1 0"/>
     <inertial pos="0 0 -0.5" mass="0.7" diaginertia="1e-12 1e-12 1e-12"/>
    </body>
   </body>
  </body>
 </worldbody>
 <equality>{tie}</equality>
</mujoco>
"""
TIE = '<connect body1="base" body2="target" anchor="0 0 0"/>'


def place(t: float) -> float:
    """Where the pivot is, m."""
    return AMPLITUDE * math.sin(FREQUENCY * t)


def speed(t: float) -> float:
    """How fast the pivot moves, m/s."""
    return AMPLITUDE * FREQUENCY * math.cos(FREQUENCY * t)


def ours(engine: str, method: str) -> Callable[[int], float]:
    """The last angle at the end, from an adapter."""
    return lambda count: float(pb.simulate(SCENE, engine, method, END / count, [END]).theta[-1, -1])


def mujoco_base(integrator: str, tied: bool) -> Callable[[int], float]:
    """The same from a chain on a base that slides."""

    def run(count: int) -> float:
        dt = END / count
        model = mujoco.MjModel.from_xml_string(MODEL.format(integrator=integrator, dt=dt, tie=TIE if tied else ""))
        data = mujoco.MjData(model)
        data.qpos[:] = [0.0, SCENE.angles[0], SCENE.angles[1] - SCENE.angles[0]]
        data.qvel[0] = speed(0.0)
        with alone():
            for step in range(count):
                if tied:
                    data.mocap_pos[0, 0] = place((step + 1) * dt)
                else:
                    data.qpos[0], data.qvel[0] = place(step * dt), speed(step * dt)
                mujoco.mj_step(model, data)
        return float(data.qpos[1] + data.qpos[2])

    return run


def pymunk_kinematic(count: int, half: float) -> float:
    """The same from pymunk, masses and pivot starting `half` a step back, and read as far ahead."""
    dt, space = END / count, pymunk.Space()
    space.iterations, space.gravity = 40, (0.0, -9.81)
    above = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    above.position = (place(-half * dt), 0.0)
    space.add(above)
    pivot, x, y, bodies = above, 0.0, 0.0, []
    for i in range(2):
        x += SCENE.lengths[i] * math.sin(SCENE.angles[i])
        y -= SCENE.lengths[i] * math.cos(SCENE.angles[i])
        body = pymunk.Body(float(SCENE.masses[i]), math.inf)
        body.velocity = (speed(0.0), 0.0)
        body.position = (x - half * dt * speed(0.0), y)
        joint = pymunk.PinJoint(above, body)
        joint.distance, joint.error_bias = float(SCENE.lengths[i]), 0.0
        space.add(body, joint)
        bodies.append(body)
        above = body
    for step in range(count):
        there, here = place((step + 1 - half) * dt), place((step - half) * dt)
        pivot.velocity = ((there - here) / dt, 0.0)
        space.step(dt)
    ends = [body.position + half * dt * body.velocity for body in bodies]
    return math.atan2(ends[1].x - ends[0].x, ends[0].y - ends[1].y)


WAYS: dict[str, Callable[[int], float]] = {
    "MuJoCo rk4, gravity of the frame (ours)": ours("mujoco", "rk4"),
    "MuJoCo rk4, base tied to a target": mujoco_base("RK4", tied=True),
    "MuJoCo rk4, base overwritten": mujoco_base("RK4", tied=False),
    "MuJoCo implicitfast, base tied to a target": mujoco_base("implicitfast", tied=True),
    "pymunk tuned, gravity of the frame (ours)": ours("pymunk", "tuned"),
    "pymunk, kinematic pivot, half a step ahead as tuned": lambda count: pymunk_kinematic(count, 0.5),
    "pymunk default, gravity of the frame (ours)": ours("pymunk", "default"),
    "pymunk, kinematic pivot": lambda count: pymunk_kinematic(count, 0.0),
}


def main() -> None:
    """Print the errors of the last angle after a second, and the order they fall with."""
    exact = float(pb.simulate(SCENE, times=[END]).theta[-1, -1])
    print(f"| way | {' | '.join(f'{count} steps/s' for count in COUNTS)} | order |")
    print("|---|" + "---|" * (len(COUNTS) + 1))
    for name, run in WAYS.items():
        errors = [abs(run(count) - exact) for count in COUNTS]
        order = -np.polyfit(np.log(COUNTS), np.log(errors), 1)[0]
        print(f"| {name} | {' | '.join(f'{error:.1e}' for error in errors)} | {order:.2f} |")


if __name__ == "__main__":
    main()
