"""A proof as a file: everything that is needed to check it, and to see that nothing in it has changed."""

from __future__ import annotations

import hashlib
import io
import json
import os
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendbench.base.errors import InputError
from pendbench.base.files import write_whole
from pendbench.base.strict import input_error, shown_path
from pendbench.scene.scene import Scene
from pendbench.truth.proof.proof import Proof

FORMAT: Final = "pendbench proof"
VERSION: Final = 1
#: What is said of how a proof was made that its check goes by, in this order.
SIZES: Final = ("bits", "order", "variation_bits", "variation_order")
_ARRAYS: Final = ("times", "theta_mid", "theta_rad", "omega_mid", "omega_rad", "balls")


def write_proof(proof: Proof, path: str | os.PathLike[str]) -> Path:
    """Write a certificate, whole or not at all. Raises `InputError` for another ending than .npz."""
    file = check_ending(path)
    arrays = {name: getattr(proof, "t" if name == "times" else name) for name in _ARRAYS}
    arrays["balls"] = arrays["balls"].astype(np.bytes_)
    about = np.array(json.dumps(_about(proof)))
    content = io.BytesIO()
    np.savez_compressed(content, about=about, digest=np.array(_digest(about, arrays)), **arrays)
    try:
        write_whole(file, lambda out: out.write(content.getvalue()))
    except OSError as error:
        raise input_error(shown_path(file), f"cannot be written: {error.strerror or error}") from None
    return file


def check_ending(path: str | os.PathLike[str]) -> Path:
    """The path. Raises `InputError` where it does not end in .npz."""
    file = Path(path)
    if file.suffix != ".npz":
        raise input_error(shown_path(file), "allowed: a name that ends in .npz")
    return file


def _about(proof: Proof) -> dict[str, Any]:
    from pendbench.truth.proof.enclose import motion_digest

    return {
        "format": FORMAT,
        "version": VERSION,
        "scene": proof.scene.name,
        "scene_file": proof.scene.to_toml(),
        "motion": motion_digest(proof.scene),
        "ended": proof.reason,
        "made": proof.made,
    }


def _digest(about: npt.NDArray[Any], arrays: dict[str, npt.NDArray[Any]]) -> str:
    content = hashlib.sha256(str(about).encode())
    for name in _ARRAYS:
        content.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        content.update(np.ascontiguousarray(arrays[name]).tobytes())
    return content.hexdigest()


def read_proof(path: str | os.PathLike[str], scene: Scene) -> Proof:
    """The proof in a file, of this scene. python-flint is not needed.

    Raises `InputError`, one line, where the file is no certificate, is not whole, or belongs to another scene. This
    does not say that what it claims is true: `check_proof` does.
    """
    from pendbench.truth.proof.enclose import motion_digest

    where = shown_path(Path(path))
    try:
        with np.load(io.BytesIO(Path(path).read_bytes()), allow_pickle=False) as file:
            held = {name: file[name] for name in (*_ARRAYS, "about", "digest")}
        about: dict[str, Any] = json.loads(str(held["about"]))
        told = about["format"], about["version"], about["motion"], about["ended"], about["made"]
        balls = held["balls"].astype(np.str_)
    except FileNotFoundError:
        raise input_error(where, "there is no such file; allowed: a certificate that `pendbench prove` wrote") from None
    except Exception:  # there is no end to what a damaged file makes zipfile, zlib and numpy raise
        raise input_error(where, "is no certificate, or not whole; allowed: what `pendbench prove` wrote") from None
    if told[:2] != (FORMAT, VERSION):
        raise input_error(where, f"is {told[0]!r}, version {told[1]!r}; allowed: {FORMAT!r}, version {VERSION}")
    if str(held["digest"]) != _digest(held["about"], held):
        raise input_error(where, "has been changed since it was made: its digest is another one")
    if told[2] != motion_digest(scene):
        raise input_error(where, f"is of another scene than {scene.name!r}: {about.get('scene')!r}, as it was then")
    if not (_arrays_fit(held, scene.n) and isinstance(told[3], str) and _made_fits(told[4])):
        raise input_error(where, "its numbers do not fit each other; allowed: what `pendbench prove` wrote")
    return Proof(
        scene=scene,
        t=held["times"],
        theta_mid=held["theta_mid"],
        theta_rad=held["theta_rad"],
        omega_mid=held["omega_mid"],
        omega_rad=held["omega_rad"],
        balls=balls,
        reason=told[3],
        made=told[4],
    )


def _arrays_fit(held: dict[str, npt.NDArray[Any]], n: int) -> bool:
    """Whether these can be a proof's arrays: whoever has the format can write a file whose digest is right."""
    times, *doubles = (held[name] for name in _ARRAYS[:-1])
    k = times.size
    return bool(
        all(its.dtype == np.float64 and np.isfinite(its).all() for its in (times, *doubles))
        and (times.shape, held["balls"].shape) == ((k,), (k, 2 * n))
        and all(its.shape == (k, n) for its in doubles)
        and (times >= 0.0).all()
        and (np.diff(times) > 0.0).all()
    )


def _made_fits(made: Any) -> bool:
    """Whether what is said of a proof's making can be gone by: sizes that are far too large take all the memory."""
    from pendbench.truth.proof.enclose import MOST_BITS

    sizes = [made.get(name) for name in SIZES] if isinstance(made, dict) else [None]
    return all(type(size) is int and 1 <= size <= MOST_BITS for size in sizes)


def check_doubles(proof: Proof) -> None:
    """Raise `InputError` where the doubles of a proof do not hold its balls, or its arrays do not fit each other."""
    from pendbench.truth.proof.numbers import precision
    from pendbench.truth.proof.text import read_ball

    k, n = len(proof.t), proof.scene.n
    shapes = [getattr(proof, name).shape for name in ("theta_mid", "theta_rad", "omega_mid", "omega_rad")]
    if shapes != [(k, n)] * 4 or proof.balls.shape != (k, 2 * n):
        raise InputError(f"its arrays are {shapes} and {proof.balls.shape}; allowed: {k} times, {n} links")
    middles = np.concatenate([proof.theta_mid, proof.omega_mid], axis=1)
    radii = np.concatenate([proof.theta_rad, proof.omega_rad], axis=1)
    with precision(256):
        for text, middle, radius in zip(*(its.ravel().tolist() for its in (proof.balls, middles, radii)), strict=True):
            if not (read_ball(text) - middle).abs_upper() <= radius:
                raise InputError(f"the certificate's doubles {middle!r} +- {radius!r} do not hold its ball {text[:60]}")
