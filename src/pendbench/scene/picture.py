"""A picture of one run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pendbench.scene.trajectory import Trajectory

_POSES: Final = 8
_MOST_ANGLES: Final = 10


def picture(run: Trajectory) -> Figure:
    """Angles over time on the left, and on the right the chain at some times with the path of its end."""
    import matplotlib.pyplot as plt

    figure, (angles, plane) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    figure.suptitle(f"{run.scene.name if run.scene else 'run'}, {run.maker or 'unknown engine'}: {run.status}")
    _draw_angles(angles, run)
    _draw_plane(plane, run)
    plt.close(figure)  # a notebook shows what a cell returns, and what is open once more
    return figure


def _draw_angles(axes: Axes, run: Trajectory) -> None:
    n = run.theta.shape[1]
    for i in np.unique(np.linspace(0, n - 1, min(n, _MOST_ANGLES)).astype(int)):
        axes.plot(run.t, run.theta[:, i], label=f"link {i + 1}", linewidth=1)
    axes.set_xlabel("t, s")
    axes.set_ylabel("angle from the downward vertical, rad")
    axes.legend(fontsize="small")


def _draw_plane(axes: Axes, run: Trajectory) -> None:
    place = run.positions
    chains = np.concatenate([np.zeros_like(place[:, :1]), place], axis=1)
    axes.plot(*place[:, -1].T, color="0.75", linewidth=0.8)
    for at in np.unique(np.linspace(0, len(chains) - 1, _POSES).astype(int)) if len(chains) else ():
        shade = 0.25 + 0.75 * at / max(1, len(chains) - 1)
        axes.plot(*chains[at].T, "o-", color="C0", alpha=shade, markersize=3, linewidth=1)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_aspect("equal", adjustable="datalim")
