"""Environments of their own for releases of a package; whatever else this process can import, they share.

So two of them differ in that package, and in what it needs and is not here already, and in nothing else.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from pendbench.base.errors import InputError, printable
from pendbench.base.files import alone_in, user_cache, write_whole

#: After so long, s, an installation is taken to hang.
_INSTALLING_S: Final = 900.0
#: Written last: which package is in the environment.
_MARK: Final = "installed"


class InstallError(Exception):
    """Why a release cannot be installed, in one line."""


@dataclass(frozen=True)
class Environment:
    """The interpreter of an environment, and what was installed into it: a package and its version."""

    python: Path
    package: str
    version: str


def folder_of_environments() -> Path:
    """Where environments are kept: in the user's cache."""
    return user_cache() / "environments"


def check_installer() -> None:
    """Raise InputError where there is nothing to make environments with."""
    if shutil.which("uv") is None and not (find_spec("venv") and find_spec("pip")):
        raise InputError("neither uv nor venv with pip is there; allowed: one of them, to install releases with")


def environment(packages: Sequence[str], version: str, fixed: Mapping[str, str]) -> Environment:
    """The environment with this version of the first of these packages that has it, kept from before or made now.

    packages: names of one program, as it was called over time. fixed: of which version other packages must be, where
    this one needs them. Raises InstallError.
    """
    held = sorted(f"{name}=={its}" for name, its in fixed.items())
    about = json.dumps([platform.python_version(), sys.base_prefix, list(packages), held])
    name = f"{packages[0]}-{version}-{hashlib.sha256(about.encode()).hexdigest()[:12]}"
    folder = folder_of_environments() / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    with alone_in(folder.parent, lambda: None):
        if not (folder / _MARK).exists():
            shutil.rmtree(folder, ignore_errors=True)
            try:
                package = _make(folder, packages, version, held)
            except BaseException:
                shutil.rmtree(folder, ignore_errors=True)
                raise
            write_whole(folder / _MARK, lambda file: file.write(package.encode()))
        _share(folder)
        return Environment(_python(folder), (folder / _MARK).read_text("utf-8"), version)


def _python(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def _make(folder: Path, packages: Sequence[str], version: str, held: Iterable[str]) -> str:
    """Make the environment, and return which of the packages is in there.

    Only wheels: a release that would have to be compiled would be another build than the one its users have.
    """
    uv, python, here = shutil.which("uv"), str(_python(folder)), sys.executable
    _run([*([uv, "venv", "--python", here] if uv else [here, "-m", "venv", "--without-pip"]), str(folder)])
    if uv:
        install = [uv, "pip", "install", "--quiet", "--python", python]
    else:
        install = [here, "-m", "pip", "--python", python, "--disable-pip-version-check", "install", "--quiet",
                   "--retries", "1"]  # fmt: skip
    constraints = folder / "constraints.txt"
    constraints.write_text("\n".join(held) + "\n", "utf-8")
    reasons: dict[str, None] = {}
    for package in packages:
        wanted = f"{package}=={version}"
        try:
            _run([*install, "--only-binary", ":all:", "--constraint", str(constraints), wanted])
            return package
        except InstallError as error:
            reasons[str(error)] = None
    raise InstallError("; ".join(reasons))


def _run(command: Sequence[str]) -> None:
    """Run a command of the installer. Raises InstallError with what it says."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", env=clean(), check=False,
                              stdin=subprocess.DEVNULL, timeout=_INSTALLING_S)  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InstallError(printable(str(error))[:300]) from None
    if done.returncode:
        raise InstallError(reason_of(done.stderr or done.stdout))


def reason_of(said: str) -> str:
    """The reason in what an installer or a command says as it fails: pip's first error, or the last line."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line.partition(":")[2].strip() for line in lines if line.lower().startswith("error:")]
    if any("from versions: none" in line for line in errors):
        errors = [f"{errors[-1]}: no version of it is to be found, or nothing is without a network"]
    chosen = errors[-1:] or lines[-1:] or ["it says nothing"]
    return printable(chosen[0])[:300]


def clean() -> dict[str, str]:
    """The environment variables of this process, without those that lead an interpreter to other packages."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}


def _share(folder: Path) -> None:
    """Let it import whatever this process can, after its own packages."""
    own = {os.path.realpath(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")}
    shared = [path for path in sys.path if path and os.path.isdir(path) and not _of_python(path, own)]
    lines = [f"import site; site.addsitedir({os.path.abspath(path)!r})\n" for path in shared]
    base = {"base": str(folder), "platbase": str(folder), "installed_base": str(folder)}
    place = Path(sysconfig.get_path("purelib", "venv", vars=base)) / "zz_pendbench.pth"
    write_whole(place, lambda file: file.write("".join(lines).encode()))


def _of_python(path: str, own: Iterable[str]) -> bool:
    """Whether a folder is the interpreter's own: its library, and what is built for it."""
    real = os.path.realpath(path)
    return any(real == place or real == os.path.join(place, "lib-dynload") for place in own)
