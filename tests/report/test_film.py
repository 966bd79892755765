"""Films and strips of a stage: they move, they are whole, and what cannot be written is one line."""

from __future__ import annotations

import dataclasses
import io
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from pendbench.base.errors import InputError
from pendbench.report.stage.film import film, strip
from support.browser import small_stage


def test_a_film_has_a_picture_for_each_moment_and_they_differ():
    found = Image.open(io.BytesIO(film(dataclasses.replace(small_stage(), duration=1.5), "gif")))
    assert found.n_frames == 30  # 20 a second
    found.seek(0)
    first = np.array(found.convert("RGB"))
    found.seek(15)
    assert (np.array(found.convert("RGB")) != first).any()
    assert found.info["duration"] == 50


def test_a_strip_shows_each_run_in_its_colour():
    picture = np.array(Image.open(io.BytesIO(strip(small_stage(), 3))).convert("RGB"))
    for colour in ([0x00, 0x72, 0xB2], [0xD5, 0x5E, 0x00]):
        assert (picture == colour).all(axis=-1).sum() > 100
    assert picture.shape[1] > 2 * picture.shape[0]


def test_a_strip_does_not_name_what_an_engine_refuses():
    stage = small_stage()
    first, second, *rest = stage.acts
    alone = dataclasses.replace(stage, acts=[first, dataclasses.replace(second, bodies=()), *rest])
    picture = np.array(Image.open(io.BytesIO(strip(alone, 3))).convert("RGB"))
    other = [int(second.colour[i : i + 2], 16) for i in (1, 3, 5)]
    assert not (picture == other).all(axis=-1).any()


def test_an_mp4_is_a_film_that_players_take(tmp_path):
    if shutil.which("ffmpeg") is None or shutil.which("ffprobe") is None:
        pytest.skip("no ffmpeg on this machine: apt-get install ffmpeg")
    path = tmp_path / "film.mp4"
    path.write_bytes(film(small_stage(), "mp4"))
    asked = "stream=codec_name,pix_fmt,nb_read_frames,width,height"
    told = subprocess.run(
        ["ffprobe", "-v", "error", "-count_frames", "-show_entries", asked, "-of", "json", str(path)],
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    (stream,) = json.loads(told)["streams"]
    assert (stream["codec_name"], stream["pix_fmt"], stream["nb_read_frames"]) == ("h264", "yuv420p", "80")
    assert stream["width"] % 2 == stream["height"] % 2 == 0


def test_without_ffmpeg_an_mp4_is_one_line(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match="needs the program ffmpeg"):
        film(small_stage(), "mp4")
