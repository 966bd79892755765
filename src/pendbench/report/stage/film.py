"""A stage as a film or a strip of pictures, for where no page can be: by matplotlib's own writers."""

from __future__ import annotations

import io
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.base.errors import InputError
from pendbench.report.numbers import number_text
from pendbench.report.plots import bounds, logarithmic
from pendbench.report.stage.records import Act, Body, Stage
from pendbench.report.text import label

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PER_S: Final = 20  # pictures a second of the film
_LONGEST_S: Final = 12.0  # a longer scene is shown faster
_TRAIL_S: Final = 0.8
_DPI: Final = 80
_COLOURS: Final = 64
_GHOST: Final = "#c9ccd3"
_MOST_MASSES: Final = 24
_LOWEST, _HIGHEST = 1e-16, 10.0


def film(stage: Stage, kind: str) -> bytes:
    """The whole stage as a film, `gif` or `mp4`. Raises `InputError` where nothing here can write it."""
    with _style(), _writer(kind) as writer, tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"film.{kind}"
        scene = _Scene(stage)
        with writer.saving(scene.figure, str(path), _DPI):
            for time in _times(stage):
                scene.show(time)
                writer.grab_frame()
        return _with_few_colours(path) if kind == "gif" else path.read_bytes()


def _with_few_colours(path: Path) -> bytes:
    """The same GIF with one small palette, that of a late picture, which makes it a third as large."""
    from PIL import Image, ImageSequence

    with Image.open(path) as film:
        pictures = [picture.convert("RGB") for picture in ImageSequence.Iterator(film)]
    palette = pictures[3 * len(pictures) // 4].quantize(_COLOURS)
    first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    file = io.BytesIO()
    first.save(
        file, "GIF", save_all=True, append_images=others, duration=1000 // _PER_S, loop=0, optimize=True, disposal=1
    )
    return file.getvalue()


@contextmanager
def _writer(kind: str) -> Iterator[AbstractMovieWriter]:
    from matplotlib import rc_context
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if kind == "gif":
        yield PillowWriter(fps=_PER_S)
        return
    with rc_context({"animation.ffmpeg_path": _ffmpeg()}):
        # Every player takes these pixels, of which there are an even number each way.
        yield FFMpegWriter(fps=_PER_S, codec="libx264", extra_args=["-pix_fmt", "yuv420p"])


def _ffmpeg() -> str:
    """Where ffmpeg is: on the path, or in the package that brings one. Raises `InputError` where it is nowhere."""
    if found := shutil.which("ffmpeg"):
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        said = "install it, or pip install imageio-ffmpeg, or ask for a gif"
        raise InputError(f"mp4 needs the program ffmpeg, which is not here; {said}") from None


def _times(stage: Stage) -> FloatArray:
    seconds = min(stage.duration, _LONGEST_S)
    return np.linspace(0.0, stage.duration, max(2, round(seconds * _PER_S)))


def strip(stage: Stage, count: int = 6) -> bytes:
    """So many moments of the stage side by side, PNG."""
    from matplotlib.figure import Figure

    with _style():
        figure = Figure(figsize=(2.4 * count, 2.9), layout="constrained")
        panels = figure.subplots(1, count, squeeze=False)[0]
        for axes, time in zip(panels, np.linspace(0.0, stage.duration, count), strict=True):
            _frame(axes, stage)
            _Chains(axes, stage).show(time)
            axes.set_title(f"{number_text(time)} s", fontsize=10)
        figure.suptitle(label(stage.title, 80), fontsize=11)
        _name_acts(figure, stage.acts)
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=_DPI * 1.5, metadata={"Software": None})
    return file.getvalue()


@contextmanager
def _style() -> Iterator[None]:
    import matplotlib.style

    with matplotlib.style.context("default"):
        yield


def _name_acts(figure: Figure, acts: Sequence[Act]) -> None:
    from matplotlib.lines import Line2D

    acts = [act for act in acts if act.bodies]  # what an engine refuses is not seen
    handles = [Line2D([], [], color=act.colour, linewidth=3) for act in acts]
    names = [label(f"{act.name} {act.detail}", 44) for act in acts]
    figure.legend(handles, names, loc="outside lower center", ncols=3, fontsize=8.5, frameon=False)


def _frame(axes: Axes, stage: Stage) -> None:
    """Axes that hold all that will move, without their lines."""
    bodies = [body for act in stage.acts for body in act.bodies]
    places = np.concatenate([body.places.reshape(-1, 2) for body in bodies])
    low, high = np.minimum(places.min(axis=0), 0.0), np.maximum(places.max(axis=0), 0.0)
    room = 0.06 * float((high - low).max())
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
    axes.set_axis_off()


class _Chains:
    """The chains of a stage in some axes, with the truth behind them."""

    def __init__(self, axes: Axes, stage: Stage) -> None:
        self._ghost = None if stage.truth is None else _Chain(axes, stage.truth.body, _GHOST, 7.0, trail=False)
        few = sum(len(act.bodies) for act in stage.acts) <= 60
        self._bodies = [
            _Chain(axes, body, body.colour, 2.0 if few else 0.7, trail=few) for act in stage.acts for body in act.bodies
        ]
        (self._pivot,) = axes.plot(0.0, 0.0, "o", color="0.15", markersize=4)

    def show(self, time: float) -> None:
        """Move to a time, s."""
        if self._ghost is not None:
            self._ghost.show(time)
        for body in self._bodies:
            body.show(time)
        self._pivot.set_data([self._bodies[0].pivot[0]], [self._bodies[0].pivot[1]])


class _Chain:
    """One chain in some axes."""

    def __init__(self, axes: Axes, body: Body, colour: str, width: float, *, trail: bool) -> None:
        self._body = body
        marker = "o" if body.places.shape[1] <= _MOST_MASSES + 1 and width > 1.0 else ""
        (self._line,) = axes.plot([], [], color=colour, linewidth=width, marker=marker, markersize=2.8 * width**0.6)
        self._trail = axes.plot([], [], color=colour, linewidth=1.0, alpha=0.5)[0] if trail else None
        self._ghostly = not trail and width > 5.0
        self.pivot = body.places[0, 0]

    def show(self, time: float) -> None:
        """Move to a time, s. What has ended stays where it was; the truth is not shown past its horizon."""
        t, places = self._body.t, self._body.places
        i = int(np.clip(np.searchsorted(t, time + 1e-9) - 1, 0, len(t) - 1))
        self._line.set_data(places[i, :, 0], places[i, :, 1])
        self.pivot = places[i, 0]
        self._line.set_visible(not (self._ghostly and time > t[-1] * (1.0 + 1e-9)))
        if self._trail is not None:
            first = int(np.searchsorted(t, time - _TRAIL_S))
            self._trail.set_data(places[first : i + 1, -1, 0], places[first : i + 1, -1, 1])


class _Scene:
    """One picture of a film: the chains, and the errors up to now."""

    def __init__(self, stage: Stage) -> None:
        from matplotlib.figure import Figure

        self.figure = Figure(figsize=(9.0, 4.6), layout="constrained")
        left, right = self.figure.subplots(1, 2, width_ratios=(1.15, 1.0))
        _frame(left, stage)
        self._chains = _Chains(left, stage)
        self._now = left.text(0.02, 0.97, "", transform=left.transAxes, va="top", fontsize=12, color="0.3")
        self._curves = [(act, right.plot([], [], color=act.colour, linewidth=1.8)[0]) for act in stage.acts]
        _error_axes(right, stage)
        _name_acts(self.figure, stage.acts)
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # once is enough: nothing but the chains moves

    def show(self, time: float) -> None:
        """Move to a time, s."""
        self._chains.show(time)
        self._now.set_text(f"{time:.1f} s")
        for act, line in self._curves:
            known = (act.error.t <= time) & (act.error.values > 0.0)
            line.set_data(act.error.t[known], np.minimum(act.error.values[known], _HIGHEST))


def _error_axes(axes: Any, stage: Stage) -> None:
    values = [value for act in stage.acts for value in act.error.values[1:]]
    logarithmic(axes, *bounds(values, _LOWEST, _HIGHEST))
    axes.set(xlim=(0.0, stage.duration), xlabel="t, s")
    axes.set_title("distance from the truth, in lengths", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)
    if stage.truth is not None and stage.truth.horizon < stage.duration:
        axes.axvspan(stage.truth.horizon, stage.duration, color="0.92")
