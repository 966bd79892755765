"""The small chains that the checks run, and how they run an engine on them. They know only the protocol."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.strict import show
from pendbench.engines.accelerations import careful as settings_with_care
from pendbench.engines.conformance.check import Subject
from pendbench.engines.protocol import AdaptiveSimulation, Simulation, State, refusal
from pendbench.physics.geometry import wrapped
from pendbench.scene.scene import Effects, Scene

DT: Final = 1e-3

Run = Simulation | AdaptiveSimulation


def chain(
    angles: FloatArray,
    rates: FloatArray,
    masses: float | FloatArray = 1.0,
    gravity: float | None = 9.81,
    length: float = 1.0,
) -> Scene:
    """Unlike links, so that a mix-up of masses or lengths shows. length: m, for each two links."""
    n = len(angles)
    return Scene(
        name="conformance",
        title="A chain of the conformance kit",
        duration=1.0,
        masses=masses * np.linspace(1.0, 0.5, n),
        lengths=length * np.linspace(0.6, 0.4, n),
        angles=angles,
        rates=rates,
        effects=Effects(gravity=gravity),
    )


def calm() -> Scene:
    """Two links in a swing that stays regular: errors grow slowly, and the order shows at moderate steps."""
    return chain(np.array([0.6, 0.9]), np.array([0.4, -0.5]))


def disordered(sign: float = 1.0, masses: float = 1.0, gravity: float | None = 9.81) -> Scene:
    """Three links, bent and moving."""
    return chain(sign * np.array([0.8, -0.3, 1.2]), sign * np.array([-0.5, 1.0, 0.3]), masses, gravity)


def careful(its: Subject) -> dict[str, float]:
    """The settings with which the method shows what it can."""
    return settings_with_care(its.engine.methods[its.method])


def build(its: Subject, scene: Scene, dt: float = DT, settings: Mapping[str, float] | None = None) -> Run:
    """A run of the scene, with care or with the settings that are given.

    Raises ValueError where it is refused, and TypeError where it is none.
    """
    refused = refusal(its.engine, its.method, scene)
    if refused is not None:
        raise ValueError(f"refused a plain chain of {scene.n}: {refused}")
    chosen = careful(its) if settings is None else settings
    run = its.engine.build(scene, its.method, None if its.adaptive else dt, **chosen)
    if not isinstance(run, AdaptiveSimulation if its.adaptive else Simulation):
        raise TypeError(f"build() gave {show(run)}, without {'advance_to()' if its.adaptive else 'advance()'}")
    return run


def forward(run: Run, steps: int, start: int = 0, dt: float = DT) -> None:
    """Advance by so many steps, or over the same time where the method chooses its steps."""
    if isinstance(run, Simulation):
        run.advance(steps)
    else:
        run.advance_to((start + steps) * dt)


def after(its: Subject, scene: Scene, steps: int = 500) -> State:
    """The state after so many steps."""
    run = build(its, scene)
    forward(run, steps)
    return run.state()


def difference(one: State, other: State) -> float:
    """The largest difference of an angle, in whole turns apart, or of a rate; infinite where one is not finite."""
    angle, rate = np.abs(wrapped(one.theta - other.theta)).max(), np.abs(one.omega - other.omega).max()
    return float(max(angle, rate)) if np.isfinite(angle + rate) else np.inf


def same_bits(one: State, other: State) -> bool:
    """Whether two states are the same to the last bit."""
    return np.array_equal(one.theta, other.theta) and np.array_equal(one.omega, other.omega)
