"""The table in docs/effects.md of what each engine does with each effect, from their adapters.

``python -m pendbench.engines.effects_table`` writes it again, in a clone with all the optional engines installed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pendbench.effects import names
from pendbench.engines.protocol import Engine, Mapped, mapped_effects
from pendbench.engines.registry import engine
from pendbench.scene.links import LINKS

#: The engines of the table.
ENGINES: Final = ("analytic", "mujoco", "pymunk", "pinocchio", "heyoka")

_BEGINS, _ENDS = "<!-- table -->\n", "<!-- end of table -->"


def effects_table() -> str:
    """A row for each effect and engine, as Markdown. Raises `MissingEngineError` where one is not installed."""
    rows = [_row(effect, engine(name)) for effect in (*names(), LINKS) for name in ENGINES]
    return "\n".join(["| effect | engine | by what means | order that is kept |", "|---|---|---|---|", *rows]) + "\n"


def _row(effect: str, its: Engine) -> str:
    mapped = mapped_effects(its).get(effect, Mapped("not known to the adapter", refused=True))
    told = f"refused: {mapped.how}" if mapped.refused else mapped.how
    return f"| `{effect}` | {its.name} | {told} | {'-' if mapped.refused else _orders(effect, its, mapped)} |"


def _orders(effect: str, its: Engine, mapped: Mapped) -> str:
    able = {name: method for name, method in its.methods.items() if method.effects is None or effect in method.effects}
    return ", ".join(f"{name} {mapped.orders.get(name, method.order)}" for name, method in able.items())


def with_table(page: str) -> str:
    """The page with the table in its place."""
    before, _, rest = page.partition(_BEGINS)
    _, _, after = rest.partition(_ENDS)
    return f"{before}{_BEGINS}{effects_table()}{_ENDS}{after}"


def main() -> None:
    """Write the table into docs/effects.md, below the working folder."""
    page = Path("docs/effects.md")
    page.write_text(with_table(page.read_text("utf-8")), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
