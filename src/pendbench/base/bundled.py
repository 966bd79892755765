"""Where the scenes and studies are that come with pendbench."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pendbench.base.errors import InputError

Kind = Literal["models", "studies", "truths"]

_PACKAGE = Path(__file__).resolve().parents[1]


def bundled(kind: Kind) -> Path:
    """The folder of the bundled files: inside an installed package, or at the top of a source checkout."""
    for folder in (_PACKAGE / "data" / kind, _PACKAGE.parents[1] / kind):
        if folder.is_dir():
            return folder
    raise InputError(f"this installation of pendbench has no bundled {kind}; install it again")


def bundled_names(kind: Kind) -> tuple[str, ...]:
    """The names of the bundled scenes or studies, sorted."""
    return tuple(sorted(file.stem for file in bundled(kind).glob("*.toml")))
