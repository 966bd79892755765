"""Does an engine keep its promises? The checks that are asked of every engine, ours or somebody else's.

    failures = check_engine(MyEngine())
    assert not failures, "\\n".join(failures)

Each check runs every method on small chains and knows nothing of the engine but the protocol. A check is a question, a
measurement and a limit (`check.py`); `check_engine` asks them here, `pendbench gate` each in a process.
"""

from __future__ import annotations

from typing import Final

from pendbench.engines.conformance import convergence, effects, honesty, model, promises
from pendbench.engines.conformance.check import SKIPPED, Check, Finding, Subject, findings, without
from pendbench.engines.protocol import Engine
from pendbench.engines.registry import engine as engine_of
from pendbench.engines.registry import flaw_of

#: In the order in which they are told: that an engine simulates another system comes before what follows from it.
CHECKS: Final[tuple[Check, ...]] = (
    promises.describes_itself,
    promises.starts_at_the_start,
    model.is_the_same_system,
    promises.gives_arrays_of_its_own,
    promises.repeats_itself,
    promises.adds_steps_up,
    promises.leaves_the_scene_alone,
    honesty.leaves_the_process_alone,
    promises.mirrors,
    promises.ignores_the_unit_of_mass,
    model.has_no_gravity_unasked,
    honesty.is_smooth,
    honesty.forgets_its_past,
    honesty.counts_its_steps,
    convergence.converges,
    convergence.balances_its_energy,
    convergence.keeps_its_momentum,
    effects.simulates_the_effects_it_maps,
    effects.converges_with_each_effect,
    promises.is_well_when_calm,
    honesty.owns_up,
)


def check_engine(engine: Engine | str) -> tuple[str, ...]:
    """Every promise that the engine breaks, one line each and naming the method; none where it conforms.

    engine: a name, or the engine itself. Never raises for what the engine does, and InputError for an unknown name.

    >>> import pendbench as pb
    >>> class Nothing:
    ...     name = "nothing"
    >>> pb.check_engine(Nothing())
    ('not an engine: it has no version()',)
    """
    engine = engine_of(engine) if isinstance(engine, str) else engine
    if flaw := flaw_of(engine):
        return (f"not an engine: {flaw}",)
    found = [finding for method in ("", *engine.methods) for finding in findings_of(Subject(engine, method))]
    return tuple(finding.line for finding in found if not finding.good)


def checks_of(method: str) -> list[Check]:
    """What is asked of a method; of the engine as a whole for ""."""
    return [each for each in CHECKS if each.whole == (not method)]


def findings_of(its: Subject) -> list[Finding]:
    """All that is found, one check after the other."""
    found: list[Finding] = []
    for asked in checks_of(its.method):
        missing = unmet(asked, found)
        found += [without(asked, its.method, SKIPPED, missing)] if missing else findings(asked, its)
    return found


def unmet(asked: Check, found: list[Finding]) -> str:
    """Why a check says nothing beside what was found before, or ""."""
    bad = {finding.check for finding in found if not finding.good}
    needed = [name for name in asked.needs if name in bad]
    return f"it says nothing where {needed[0]!r} does not hold" if needed else ""
