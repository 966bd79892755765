"""A real browser, driven by playwright, and pages of which every number is known."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendbench.report.stage.page import stage_page
from pendbench.report.stage.records import Act, Body, Curve, Stage, Truth

_PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def program() -> str:
    """Where the browser is; the test is skipped where there is none, and where nothing drives it."""
    pytest.importorskip("playwright", reason="playwright is not installed: pip install 'pendbench[test]'")
    found = next(filter(None, map(shutil.which, _PROGRAMS)), None)
    if found is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    return found


@contextmanager
def browser() -> Iterator[Any]:
    """A headless Chromium."""
    path = program()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=path, args=["--no-sandbox", "--force-color-profile=srgb"])
        try:
            yield opened
        finally:
            opened.close()


class Visit:
    """A page as somebody sees it, with all that it says to the console, asks of the network or fails with."""

    def __init__(self, opened: Any, path: Path, **settings: Any) -> None:
        self.context = opened.new_context(**{"viewport": {"width": 1200, "height": 900}, **settings})
        self.page = self.context.new_page()
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda said: self.complaints.append(said.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())

    def settle(self) -> None:
        """Wait until a frame is drawn."""
        self.page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def set_time(self, time: float) -> None:
        """Go to a time, s."""
        self.page.evaluate(f"() => {{ pendbench.clock.pause(); pendbench.clock.set({time!r}); }}")
        self.settle()

    def time(self) -> float:
        """The time shown, s."""
        return float(self.page.evaluate("() => pendbench.clock.time"))


def swinging(k: int, rate: float, amplitude: float) -> np.ndarray:
    """Places (k, 3, 2) m of a double pendulum of a metre whose rods swing by made-up angles: no physics is needed."""
    t = np.linspace(0.0, 4.0, k)
    one, two = amplitude * np.cos(rate * t), 1.3 * amplitude * np.cos(rate * t + 0.4)
    first = 0.5 * np.stack([np.sin(one), -np.cos(one)], axis=1)
    second = first + 0.5 * np.stack([np.sin(two), -np.cos(two)], axis=1)
    return np.stack([np.zeros((k, 2)), first, second], axis=1)


def act(name: str, colour: str, rate: float, k: int = 401) -> Act:
    """An engine that swings at a rate of its own, with an error and an energy that grow."""
    t = np.linspace(0.0, 4.0, k)
    body = Body(t, swinging(k, rate, 1.0), colour)
    known = t[t <= 3.0]
    return Act(
        name, "rk4, step 0.001 s", colour, (body,), Curve(known, 1e-6 * np.exp(3 * known)), Curve(t, 1e-9 * (1 + t))
    )


def small_stage(title: str = "A small stage", **changes: Any) -> Stage:
    """Two engines over 4 s, and a truth that ends at 3 s."""
    t = np.linspace(0.0, 3.0, 301)
    ghost = Truth(Body(t, swinging(401, 3.0, 1.0)[:301]), Curve(t, 1e-20 * np.exp(9 * t)), 3.0)
    acts = (act("analytic", "#0072b2", 3.0), act("mujoco", "#d55e00", 3.2))
    known: dict[str, Any] = {
        "title": title, "name": "small", "links": 2, "duration": 4.0, "length": 1.0, "acts": acts, "truth": ghost,
        "error_says": "Error", "energy_says": "Energy", "words": ("It swings.",), "facts": (("scene", "small"),),
    }  # fmt: skip
    return Stage(**{**known, **changes})


def write_stage(stage: Stage, folder: Path) -> Path:
    """The page of a stage, as a file."""
    path = folder / "page.html"
    path.write_text(stage_page(stage), "utf-8")
    return path
