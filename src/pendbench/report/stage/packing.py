"""Numbers as text that a page unpacks: base64 of little-endian numbers."""

from __future__ import annotations

import base64
import json
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from pendbench.base.arrays import FloatArray
from pendbench.report.charts import Axis, Chart, Line, Panel
from pendbench.report.stage.records import Act, Body, Curve, FlipStage, Stage, Truth
from pendbench.report.stage.thinning import curve_drawn

_FULL: Final = 32767
_NEVER: Final = 65535
_BEYOND: Final = 0.25  # of an axis, at each end
_BLACK: Final = "#000000"
#: What a curve on a logarithmic axis can show; what is larger is drawn at its edge.
_LARGEST: Final = 1e30


def packed_stage(stage: Stage) -> dict[str, Any]:
    """All of a stage that its script needs, as what JSON can hold."""
    return {
        "duration": stage.duration,
        "length": stage.length,
        "links": stage.links,
        "acts": [_act(act, stage.length) for act in stage.acts],
        "truth": None if stage.truth is None else _truth(stage.truth, stage.length),
    }


def packed_flips(stage: FlipStage) -> dict[str, Any]:
    """All of a map that its script needs: times to a 65534th of the duration; what is not known never flips."""
    with np.errstate(invalid="ignore"):
        kept = np.where(stage.times <= stage.duration, np.rint(stage.times / stage.duration * (_NEVER - 1)), _NEVER)
    return {
        "size": len(stage.times),
        "times": _base64(kept, "<u2"),
        "duration": stage.duration,
        "masses": list(stage.masses),
        "lengths": list(stage.lengths),
        "gravity": stage.gravity,
        "start": list(stage.start),
        "colour": stage.colour,
    }


def packed_chart(chart: Chart, most: int) -> dict[str, Any]:
    """All of a chart that its script needs, with at most about so many points for each line."""
    return {"title": chart.title, "panels": [_panel(panel, most) for panel in chart.panels]}


def json_text(content: Any) -> str:
    """JSON that can stand inside a script element: no markup can end it."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _act(act: Act, length: float) -> dict[str, Any]:
    return {
        "name": act.name,
        "detail": act.detail,
        "colour": act.colour,
        "dashes": list(act.dashes),
        "hollow": act.hollow,
        "bodies": [_body(body, length) for body in act.bodies],
        "error": _curve(act.error),
        "energy": _curve(act.energy),
        "leaves": act.leaves if np.isfinite(act.leaves) else None,
        "ended": act.ended,
    }


def _truth(truth: Truth, length: float) -> dict[str, Any]:
    return {
        "body": _body(truth.body, length),
        "bound": _curve(truth.bound),
        "horizon": truth.horizon,
        "ends": truth.ends,
    }


def _body(body: Body, length: float) -> dict[str, Any]:
    """Places in units of the chain's length: no mass is farther than that from the pivot at rest."""
    reach = max(length, float(np.abs(body.places).max(initial=0.0)))
    places = np.rint(body.places * (_FULL / reach))
    return {
        "t": _base64(body.t, "<f8"),
        "points": body.places.shape[1],
        "reach": reach,
        "places": _base64(places, "<i2"),
        "colour": body.colour,
    }


def _curve(curve: Curve) -> dict[str, str]:
    values = np.where(np.isfinite(curve.values), np.abs(curve.values), np.where(np.isnan(curve.values), 0.0, _LARGEST))
    return {"t": _base64(curve.t, "<f4"), "values": _base64(np.minimum(values, _LARGEST), "<f4")}


def _panel(panel: Panel, most: int) -> dict[str, Any]:
    return {
        "title": panel.title,
        "x": asdict(panel.x),
        "y": asdict(panel.y),
        "lines": [_line(line, panel, most) for line in panel.lines],
        "rules": [asdict(rule) for rule in panel.rules],
        "notes": list(panel.notes),
    }


def _line(line: Line, panel: Panel, most: int) -> dict[str, Any]:
    """The points as shares of the axes, a quarter of an axis beyond each end among them, to a 65000th."""
    kept = curve_drawn(line.y, most) if line.joined else np.arange(len(line.y))
    shares = np.stack([_shares(line.x[kept], panel.x), _shares(line.y[kept], panel.y)], axis=1)
    return {
        "points": _base64(np.rint(shares * _NEVER), "<u2"),
        **{
            name: getattr(line, name)
            for name in ("colour", "width", "joined", "dashed", "stairs", "marker", "size", "filled")
        },
        "strong": line.colour == _BLACK,
        "mark": None if line.mark is None else asdict(line.mark),
    }


def _shares(values: FloatArray, axis: Axis) -> FloatArray:
    ends, places = np.array([axis.low, axis.high]), values
    if axis.log:
        ends, places = np.log10(ends), np.log10(np.maximum(values, np.finfo(np.float64).tiny))
    share = (places - ends[0]) / (ends[1] - ends[0])
    return np.asarray(np.clip((share + _BEYOND) / (1.0 + 2.0 * _BEYOND), 0.0, 1.0))


def _base64(values: FloatArray, form: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=form).tobytes()).decode("ascii")
