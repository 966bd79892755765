"""How a line of the command can go on: what a shell offers for Tab."""

from __future__ import annotations


def study_names(prefix: str, **_: object) -> list[str]:
    """Bundled studies, and files."""
    return _names_and_files(prefix, "studies", ["toml"])


def scene_names(prefix: str, **_: object) -> list[str]:
    """Bundled scenes and files, after the last comma of a list."""
    before = prefix[: prefix.rfind(",") + 1]
    return [before + name for name in _names_and_files(prefix[len(before) :], "models", ["toml", "xml", "urdf"])]


def _names_and_files(prefix: str, kind: str, endings: list[str]) -> list[str]:
    from argcomplete.completers import FilesCompleter

    from pendbench.base.bundled import bundled_names

    return [*bundled_names(kind), *FilesCompleter(endings)(prefix)]  # type: ignore[arg-type]
