"""Does an engine keep the promises of the protocol? A kit of checks for any adapter, ours or somebody else's.

    failures = check_engine(MyEngine())
    assert not failures, "\\n".join(failures)

Each check runs every method on a small chain and knows nothing of the engine but the protocol. The truth it compares
with is the dense form of the equations, integrated by scipy: it shares no code with any engine.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from functools import cache
from typing import Final

import numpy as np

from pendbench.arrays import FloatArray
from pendbench.effects import examples as effect_examples
from pendbench.effects import names as effect_names
from pendbench.engines.protocol import AdaptiveSimulation, Engine, Fault, Simulation, State, mapped_effects, refusal
from pendbench.engines.registry import flaw_of
from pendbench.errors import describe
from pendbench.physics.geometry import wrapped
from pendbench.scene import Effects, Scene
from pendbench.strict import show
from pendbench.trajectory import STATUSES

#: How far a measured order of convergence may be from the one that is claimed.
ORDER_SLACK: Final = 0.2

_DT: Final = 1e-3
# Two runs that differ by rounding only, over a short calm swing: far above what 500 steps gather, and what an adaptive
# method at its default tolerance leaves; far below the error of any method at this step.
_ROUNDING: Final = 1e-9
# The ladder of steps for the order: fractions of a second. Errors outside this window say nothing of the order: above
# it the method is not in its limit yet, below it is rounding.
_LADDER: Final = (16, 32, 64, 128, 256, 512, 1024)
_WINDOW: Final = (1e-11, 2e-2)
_RUNGS: Final = 3
_SAMPLES: Final = 4
# By order (2 and more): how much of what effects change a method may miss at this step. Measured: up to 0.011 of order
# 1, and up to 3e-5 of the others.
_MISSED: Final = {1: 0.04, 2: 0.005}

Run = Simulation | AdaptiveSimulation
Check = Callable[[Engine, str], Iterator[str]]


def check_engine(engine: Engine) -> tuple[str, ...]:
    """Every promise that the engine breaks, one line each and naming the method; none where it conforms.

    Never raises for what the engine does.
    """
    if flaw := flaw_of(engine):
        return (f"not an engine: {flaw}",)
    failures = [*_attempt("engine", lambda: _describes_itself(engine))]
    for method in engine.methods:
        for check in _CHECKS:
            name = f"{method}, {check.__name__.strip('_').replace('_', ' ')}"
            failures += _attempt(name, lambda check=check, method=method: check(engine, method))  # type: ignore[misc]
    return tuple(failures)


def _attempt(name: str, check: Callable[[], Iterator[str]]) -> list[str]:
    """The failures of a check, one of which may be that it could not be run to its end."""
    failures: list[str] = []
    try:
        failures.extend(f"{name}: {failure}" for failure in check())
    except Exception as error:
        failures.append(f"{name}: raised {describe(error)}")
    return failures


# The chains that the checks run.


def _chain(angles: FloatArray, rates: FloatArray, masses: float = 1.0, gravity: float | None = 9.81) -> Scene:
    """Unlike links, so that a mix-up of masses or lengths shows."""
    n = len(angles)
    return Scene(
        name="conformance",
        title="A chain of the conformance kit",
        duration=1.0,
        masses=masses * np.linspace(1.0, 0.5, n),
        lengths=np.linspace(0.6, 0.4, n),
        angles=angles,
        rates=rates,
        effects=Effects(gravity=gravity),
    )


def _calm() -> Scene:
    """Two links in a swing that stays regular: errors grow slowly, and the order shows at moderate steps."""
    return _chain(np.array([0.6, 0.9]), np.array([0.4, -0.5]))


def _disordered(sign: float = 1.0, masses: float = 1.0) -> Scene:
    """Three links, bent and moving."""
    return _chain(sign * np.array([0.8, -0.3, 1.2]), sign * np.array([-0.5, 1.0, 0.3]), masses)


# Running an engine.


def _build(engine: Engine, scene: Scene, method: str, dt: float = _DT, **settings: float) -> Run:
    refused = refusal(engine, method, scene)
    if refused is not None:
        raise ValueError(f"refused a plain chain of {scene.n}: {refused}")
    adaptive = engine.methods[method].adaptive
    run = engine.build(scene, method, None if adaptive else dt, **settings)
    if not isinstance(run, AdaptiveSimulation if adaptive else Simulation):
        raise TypeError(f"build() gave {show(run)}, without {'advance_to()' if adaptive else 'advance()'}")
    return run


def _forward(run: Run, steps: int, start: int = 0, dt: float = _DT) -> None:
    """Advance by so many steps, or over the same time where the method chooses its steps."""
    if isinstance(run, Simulation):
        run.advance(steps)
    else:
        run.advance_to((start + steps) * dt)


def _after(engine: Engine, scene: Scene, method: str, steps: int = 500) -> State:
    run = _build(engine, scene, method)
    _forward(run, steps)
    return run.state()


def _difference(one: State, other: State) -> float:
    """The largest difference of an angle, in whole turns apart, or of a rate; infinite where one is not finite."""
    angle, rate = np.abs(wrapped(one.theta - other.theta)).max(), np.abs(one.omega - other.omega).max()
    return float(max(angle, rate)) if np.isfinite(angle + rate) else np.inf


def _same_bits(one: State, other: State) -> bool:
    return np.array_equal(one.theta, other.theta) and np.array_equal(one.omega, other.omega)


# The checks. Each yields what it finds wrong.


def _describes_itself(engine: Engine) -> Iterator[str]:
    if not (engine.name and engine.name.isprintable()):
        yield f"its name is {show(engine.name)}; it must be printable text"
    version = engine.version()
    if not (isinstance(version, str) and version):
        yield f"version() gave {show(version)}; it must be text"
    for name, method in engine.methods.items():
        if not (isinstance(name, str) and name):
            yield f"a method is called {show(name)}; its name must be text"
        if method.order < 1:
            yield f"method {name!r} claims order {show(method.order)}; it must be 1 or more"
        for key, setting in method.settings.items():
            default = setting.low if setting.default is None else setting.default
            if not setting.low <= default <= setting.high:
                yield f"the default of {key!r}, method {name!r}, is outside its own bounds"


def _starts_at_the_start(engine: Engine, method: str) -> Iterator[str]:
    scene = _disordered()
    run = _build(engine, scene, method)
    off = _difference(run.state(), State(scene.angles, scene.rates))
    if not off < _ROUNDING:
        yield f"at time 0 the state is off the scene's start by {off:.2g}"
    if (fault := run.health()) is not None:
        yield f"at time 0 health() says {show(str(fault))}"


def _gives_arrays_of_its_own(engine: Engine, method: str) -> Iterator[str]:
    run, twin = _build(engine, _disordered(), method), _build(engine, _disordered(), method)
    before = run.state()
    for name, array in (("theta", before.theta), ("omega", before.omega)):
        if not isinstance(array, np.ndarray) or array.shape != (3,) or array.dtype != np.float64:
            yield f"{name} is not a float64 array of shape (3,)"
            return
    kept = State(before.theta.copy(), before.omega.copy())
    _forward(run, 3)
    if not _same_bits(before, kept):
        yield "a state that was read changes when the run goes on"
    before = run.state()
    before.theta[:], before.omega[:] = 9.0, 9.0
    _forward(run, 2, start=3)
    _forward(twin, 3)
    _forward(twin, 2, start=3)
    if not _difference(run.state(), twin.state()) < _ROUNDING:
        yield "writing into a state that was read changes the run"


def _repeats_itself(engine: Engine, method: str) -> Iterator[str]:
    run, twin = _build(engine, _disordered(), method), _build(engine, _disordered(), method)
    before = twin.state()
    _forward(run, 50)
    if not _difference(before, twin.state()) < _ROUNDING:
        yield "advancing one run moves another"
        return
    _forward(twin, 50)
    if not _same_bits(run.state(), twin.state()):
        yield "two runs of one scene differ"


def _adds_steps_up(engine: Engine, method: str) -> Iterator[str]:
    whole, parts = _build(engine, _disordered(), method), _build(engine, _disordered(), method)
    _forward(whole, 5)
    _forward(parts, 2)
    parts.state()
    _forward(parts, 3, start=2)
    apart = _difference(whole.state(), parts.state())
    if isinstance(whole, Simulation) and not _same_bits(whole.state(), parts.state()):
        yield f"2 steps and 3 steps are not the same as 5 steps: {apart:.2g} apart"
    elif not apart < _ROUNDING:
        yield f"going on from a time on the way ends {apart:.2g} apart"


def _leaves_the_scene_alone(engine: Engine, method: str) -> Iterator[str]:
    scene = _disordered()
    before = scene.digest
    _forward(_build(engine, scene, method), 5)
    if scene.digest != before:
        yield "the scene was changed"


def _mirrors(engine: Engine, method: str) -> Iterator[str]:
    left, right = _after(engine, _disordered(), method), _after(engine, _disordered(sign=-1.0), method)
    off = _difference(left, State(-right.theta, -right.omega))
    if not off < _ROUNDING:
        yield f"the mirrored chain does not move in the mirror: off by {off:.2g}"


def _ignores_the_unit_of_mass(engine: Engine, method: str) -> Iterator[str]:
    one, other = _after(engine, _disordered(), method), _after(engine, _disordered(masses=1000.0), method)
    off = _difference(one, other)
    if not off < _ROUNDING:
        yield f"a thousand times the mass moves differently: off by {off:.2g}"


def _has_no_gravity_unasked(engine: Engine, method: str) -> Iterator[str]:
    scene = _chain(np.array([1.0]), np.array([2.0]), gravity=None)
    found = _after(engine, scene, method)
    # Methods that stretch the rod lose rate in proportion to the step; gravity would change it by several rad/s.
    off = abs(float(found.omega[0]) - 2.0)
    if not off < 0.01:
        yield f"without gravity, a single link's rate changes by {off:.2g} rad/s"


def _converges(engine: Engine, method: str) -> Iterator[str]:
    if engine.methods[method].adaptive:
        yield from _obeys_its_tolerance(engine, method)
        return
    steps, errors = _order_errors(engine, method)
    if len(steps) < 2:
        yield f"no two errors between {_WINDOW[0]:g} and {_WINDOW[1]:g} at steps of {1 / _LADDER[0]:g} s and less"
        return
    order, claimed = -np.polyfit(np.log(steps), np.log(errors), 1)[0], engine.methods[method].order
    if not abs(order - claimed) <= ORDER_SLACK:
        last = f"errors {errors[0]:.2g} and {errors[-1]:.2g} at {steps[0]} and {steps[-1]} steps a second"
        yield f"its order is {order:.2f}, and it claims {claimed}: {last}"


def _order_errors(engine: Engine, method: str) -> tuple[list[int], list[float]]:
    """Numbers of steps a second and the errors they leave, the finest few that say something."""
    scene, truth = _calm(), _truth()
    found: list[tuple[int, float]] = []
    for steps in _LADDER:
        run = _build(engine, scene, method, dt=1.0 / steps)
        error = 0.0
        for k in range(_SAMPLES):
            _forward(run, steps // _SAMPLES, start=k * steps // _SAMPLES)
            error = max(error, _difference(run.state(), truth[k]))
        if _WINDOW[0] < error < _WINDOW[1]:
            found.append((steps, error))
    chosen = found[-_RUNGS:]
    return [steps for steps, _ in chosen], [error for _, error in chosen]


def _obeys_its_tolerance(engine: Engine, method: str) -> Iterator[str]:
    def error(**settings: float) -> float:
        run = _build(engine, _calm(), method, **settings)
        _forward(run, 1, dt=1.0)
        return _difference(run.state(), _truth()[-1])

    if not error() < 1e-6:
        yield f"at its default settings its error is {error():.2g} after 1 s"
    if "tolerance" in engine.methods[method].settings:
        loose, tight = error(tolerance=1e-4), error(tolerance=1e-9)
        if not tight < 0.01 * loose:
            yield f"its error falls from {loose:.2g} only to {tight:.2g} with a tolerance 1e5 times as tight"


def _first_with(engine: Engine, effect: str) -> str:
    """The first of the engine's methods that knows the effect."""
    knows = {name: method.effects is None or effect in method.effects for name, method in engine.methods.items()}
    return next(name for name, it_does in knows.items() if it_does)


def _simulates_the_effects_it_maps(engine: Engine, method: str) -> Iterator[str]:
    """What its effects change in a calm chain: all together, and each alone by the first method that knows it."""
    mapped = mapped_effects(engine)
    if unknown := sorted(set(mapped) - set(effect_names())):
        yield f"effects has {show(unknown[0])}; allowed: {', '.join(effect_names())}"
        return
    own = engine.methods[method].effects
    known = [name for name, means in mapped.items() if name != "gravity" and not means.refused]
    names = [name for name in known if own is None or name in own]
    if not names:
        return
    allowed = _MISSED[min(2, engine.methods[method].order)]
    together = _misses(engine, method, names)
    alone = names if not together < allowed else [name for name in names if _first_with(engine, name) == method]
    off = {name: _misses(engine, method, [name]) for name in alone}
    wrong = [name for name in alone if not off[name] < allowed]
    if not wrong and not together < allowed:
        yield f"{', '.join(names)}: each alone is right, together they are not"
    for name in wrong:
        yield f"{name}: what it changes in half a second is off by {off[name]:.2g} of it"


def _misses(engine: Engine, method: str, names: list[str]) -> float:
    """How far what effects change in the engine is from what they change in truth, as a share of it."""
    chosen = {name: effect_examples()[name] for name in names}
    scene = dataclasses.replace(_calm(), effects=Effects(gravity=9.81, **chosen))
    before, after = (_after(engine, each, method) for each in (_calm(), scene))
    bare, changed = _truth()[1], _solved(scene)[1]
    change = np.concatenate([after.theta - before.theta, after.omega - before.omega])
    right = np.concatenate([changed.theta - bare.theta, changed.omega - bare.omega])
    return float(np.abs(change - right).max() / np.abs(right).max())


@cache
def _truth() -> tuple[State, ...]:
    """The calm chain at each quarter of a second."""
    return _solved(_calm())


def _solved(scene: Scene) -> tuple[State, ...]:
    """The chain at each quarter of a second. equations.md (E6), by Dormand and Prince's method of order 8."""
    from scipy.integrate import solve_ivp

    from pendbench.physics.dense import accelerations

    def slope(t: float, y: FloatArray) -> FloatArray:
        theta, omega = np.split(y, 2)
        return np.concatenate([omega, accelerations(scene, theta, omega, t)])

    times, y = np.arange(1, _SAMPLES + 1) / _SAMPLES, np.concatenate([scene.angles, scene.rates])
    found = solve_ivp(slope, (0.0, 1.0), y, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-14).y.T
    return tuple(State(row[: scene.n], row[scene.n :]) for row in found)


def _is_well_when_calm(engine: Engine, method: str) -> Iterator[str]:
    run = _build(engine, _calm(), method)
    _forward(run, 500)
    if (fault := run.health()) is not None:
        yield f"a calm run is reported as {show(str(fault))}"
    if not abs(run.state().gap) < 0.01:
        yield f"in a calm run a rod is off its length by {run.state().gap:.2g} of it"


def _owns_up(engine: Engine, method: str) -> Iterator[str]:
    """Ask for what cannot go well: steps of many turns, of a whipping chain."""
    scene = _chain(np.linspace(0.0, 2.0, 5), np.full(5, 30.0))
    run = _build(engine, scene, method, dt=10.0)
    for k in range(20):
        if isinstance(run, Simulation):
            run.advance(5)
        else:
            run.advance_to(0.01 * (k + 1))
        fault = run.health()
        if fault is not None:
            yield from _flaws_of_fault(fault)
            return
        state = run.state()
        if not (np.all(np.isfinite(state.theta)) and np.all(np.isfinite(state.omega))):
            yield "the state is not finite, and health() says nothing"
            return


def _flaws_of_fault(fault: Fault) -> Iterator[str]:
    if not isinstance(fault, Fault):
        yield f"health() gave {show(fault)}; it must be a Fault or None"
    elif fault.status not in STATUSES or fault.status == "ok":
        yield f"health() gave the status {show(fault.status)}; allowed: {', '.join(STATUSES)}"
    elif not fault.reason:
        yield f"health() gave no reason for {fault.status!r}"


_CHECKS: Final[tuple[Check, ...]] = (
    _starts_at_the_start,
    _gives_arrays_of_its_own,
    _repeats_itself,
    _adds_steps_up,
    _leaves_the_scene_alone,
    _mirrors,
    _ignores_the_unit_of_mass,
    _has_no_gravity_unasked,
    _converges,
    _simulates_the_effects_it_maps,
    _is_well_when_calm,
    _owns_up,
)
