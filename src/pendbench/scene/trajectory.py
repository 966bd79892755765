"""What a run leaves behind: times, angles, rates and how it ended, with the scene and what made it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.base.faults import STATUSES
from pendbench.base.notebook import shown
from pendbench.scene.scene import Scene

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Maker:
    """What made a run: an engine's method, with its step (s; None where it chooses its own) and the settings asked for.

    versions: of pendbench and of the program behind the engine, by name.
    """

    engine: str
    method: str
    dt: float | None = None
    settings: tuple[tuple[str, float], ...] = ()
    versions: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        step = "" if self.dt is None else f" dt={self.dt:g}"
        return f"{self.engine} {self.method}{step}{''.join(f' {key}={value:g}' for key, value in self.settings)}"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Samples of one run. A run that failed holds the samples from before it failed, one that lost its energy all.

    t: (k,) s; theta: (k, n) rad, absolute angles; omega: (k, n) rad/s; gap: (k,) how far the worst rod is from its
    length, over that length (0 for engines that work in angles); steps: how many steps were taken, where the engine
    can tell; scene and maker: what was run, and what ran it.

    >>> import pendbench as pb
    >>> run = pb.simulate("double", engine="mujoco", method="rk4", dt=1e-3, times=[0.0, 0.5, 1.0])
    >>> run
    <Trajectory of 'double' by mujoco rk4 dt=0.001: 3 samples of 2 links, 0 to 1 s, ok>
    >>> run.positions.shape
    (3, 2, 2)
    """

    t: FloatArray
    theta: FloatArray
    omega: FloatArray
    gap: FloatArray
    status: str = "ok"
    reason: str = ""
    steps: int | None = None
    scene: Scene | None = None
    maker: Maker | None = None

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"unknown status {self.status!r}")

    def __repr__(self) -> str:
        of = f" of {self.scene.name!r}" if self.scene else ""
        by = f" by {self.maker}" if self.maker else ""
        k, n = self.theta.shape
        span = f", {self.t[0]:g} to {self.t[-1]:g} s" if k else ""
        ending = self.status if self.status == "ok" or not self.reason else f"{self.status}: {self.reason}"
        return f"<{type(self).__name__}{of}{by}: {k} samples of {n} link{'s' * (n != 1)}{span}, {ending}>"

    def _repr_html_(self) -> str | None:
        """The run in motion, for a notebook; None, so that it shows the text, where there is nothing to be shown."""
        try:
            return shown(self)
        except InputError:
            return None

    @property
    def positions(self) -> FloatArray:
        """Where each link ends, (k, n, 2) m, x to the right and y upwards from the pivot, wherever that is."""
        from pendbench.physics.geometry import positions

        return positions(self._its_scene.lengths, self.theta)

    @property
    def energy(self) -> FloatArray:
        """Kinetic plus potential energy at each sample, (k,) J, as `pendbench.energy` says."""
        from pendbench.physics.energy import energy

        return energy(self._its_scene, self.theta, self.omega)

    @property
    def tensions(self) -> FloatArray:
        """How hard each link is pulled at its joint, along itself, (k, n) N; negative where it is pushed.

        On massless rods this is the rod's tension, the same all along. It follows from the equations of motion at each
        sample's angles and rates: what an engine's own joints feel may differ, and is not asked for.

        >>> import pendbench as pb
        >>> scene = pb.Scene.chain(n=2, length=1.0, mass=3.0, angles=0.0, gravity=10.0)
        >>> pb.simulate(scene, times=[0.0]).tensions  # at rest, hanging: the weight of two masses, and of one
        array([[60., 30.]])
        """
        from pendbench.scene.tensions import tensions

        return tensions(self._its_scene, self.t, self.theta, self.omega)

    @property
    def _its_scene(self) -> Scene:
        if self.scene is None:
            raise InputError("this trajectory does not say which scene it is of; allowed: Trajectory(..., scene=...)")
        return self.scene

    def to_frame(self) -> pd.DataFrame:
        """A table with a row for each sample: t, theta_1 .., omega_1 .., x_1, y_1 .., energy and gap; links from 1.

        >>> import pendbench as pb
        >>> list(pb.simulate("single", times=[0.0, 1.0]).to_frame())
        ['t', 'theta_1', 'omega_1', 'x_1', 'y_1', 'energy', 'gap']
        """
        import pandas as pd

        links = range(self.theta.shape[1])
        place = self.positions
        columns = {"t": self.t}
        for name, values in (("theta", self.theta), ("omega", self.omega), ("x", place[..., 0]), ("y", place[..., 1])):
            columns |= {f"{name}_{i + 1}": values[:, i] for i in links}
        return pd.DataFrame(columns | {"energy": self.energy, "gap": self.gap})

    def plot(self) -> Figure:
        """A picture of the run: every angle over time, and the path of the chain's end."""
        from pendbench.scene.picture import picture

        return picture(self)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the run, its scene and its maker to a file that `pendbench.load_run` reads: plain numpy, `.npz`.

        Of a reference, what it says of its own error is left out. Raises InputError where the file cannot be written.
        """
        from pendbench.scene.run_file import write_run

        write_run(self, path)
