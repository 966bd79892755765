"""A plugin of pytest: `pytest --pendbench ENGINE`, and the fixture `pendbench_gate`. Without either it does nothing."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import pytest

if TYPE_CHECKING:
    from pendbench.commands.gate_record import Gate

_FOUND: Final = pytest.StashKey[dict[str, "Gate"]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option that asks for it."""
    group = parser.getgroup("pendbench")
    group.addoption("--pendbench", metavar="ENGINE", help="ask this engine every check of pendbench: a test for each")


def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """A test for each check, after all others."""
    engine = config.getoption("--pendbench")
    if engine:
        from pendbench.engines.gating.gate import names_of_checks

        items.extend(_Check.from_parent(session, name=f"pendbench[{name}]", check=name) for name in names_of_checks())


def _gate(config: pytest.Config, engine: Any = None, **asked: Any) -> Gate:
    """What a gate finds; that of the engine of the option is run once."""
    import pendbench

    chosen = config.getoption("--pendbench")
    if engine is not None or asked or not chosen:
        return pendbench.gate(engine, **asked)
    found = config.stash.setdefault(_FOUND, {})
    if chosen not in found:
        found[chosen] = pendbench.gate(chosen)
    return found[chosen]


class _FailedError(Exception):
    """What a check found, a line each."""


class _Check(pytest.Item):
    """One check, of every method."""

    def __init__(self, *, check: str, **rest: Any) -> None:
        super().__init__(**rest)
        self._check = check

    def runtest(self) -> None:
        found = [each for each in _gate(self.config).checks if each.check == self._check]
        bad = [each.line for each in found if not each.good]
        if bad:
            raise _FailedError("\n".join(bad))
        if all(each.status == "skipped" for each in found):
            pytest.skip(found[0].cause if found else "it was not asked")
        for each in found:
            self.user_properties.append((f"{each.method} {each.about}".strip() or "value", each.value))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, _FailedError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Any, int | None, str]:
        return self.path, None, self.name


@pytest.fixture(scope="session")
def pendbench_gate(request: pytest.FixtureRequest) -> Callable[..., Gate]:
    """`pendbench.gate`; without arguments it is about the engine of `--pendbench`."""
    return partial(_gate, request.config)
