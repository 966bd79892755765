"""Any values as TOML."""

from __future__ import annotations

import string
from datetime import date


def toml(value: object) -> str:
    """A value as TOML writes it; what TOML has not becomes text."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return str(value)
        case date():
            return value.isoformat()
        case list():
            return f"[{', '.join(map(toml, value))}]"
        case dict():
            return f"{{{', '.join(f'{text(key)} = {toml(inner)}' for key, inner in value.items())}}}"
        case _:
            return text(str(value))


def text(value: str) -> str:
    plain = string.ascii_letters + string.digits + "._/"
    return '"' + "".join(c if c in plain else f"\\U{ord(c):08x}" for c in value) + '"'
