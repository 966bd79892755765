"""What is made of timings, with a clock that goes as the test says."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pendbench.base.faults import Fault
from pendbench.measures import clock
from pendbench.measures.clock import Race, race, time_case, time_each_step
from pendbench.measures.clock import timed as timed_call
from support.scenes import chain

SCENE = chain(1)
#: How slow each run is: the first, that which finds how many steps fill a sample, and those of the five samples.
SLOWNESS = (3.0, 1.0, 1.2, 1.1, 1.4, 1.3, 1.5)


class Run:
    """A step takes 1 ms times its slowness; a whole run 25 steps."""

    def __init__(self, watch, slowness):
        self._watch, self._step_s = watch, 1e-3 * slowness

    def advance(self, steps):
        self._watch.now += steps * self._step_s

    def state(self):
        return None

    def health(self):
        return None


class Whole:
    """The same, for a method that chooses its steps."""

    def __init__(self, watch, slowness):
        self._watch, self._step_s = watch, 1e-3 * slowness

    def advance_to(self, time):
        self._watch.now += 25 * self._step_s * time
        return 25

    def state(self):
        return None

    def health(self):
        return None


def timed(monkeypatch, kind, dt):
    watch, slowness = SimpleNamespace(now=0.0), iter(SLOWNESS if dt else SLOWNESS[:1] + SLOWNESS[2:])

    def build(*_, **__):
        watch.now += 2.0
        return kind(watch, next(slowness))

    monkeypatch.setattr(clock, "time", SimpleNamespace(perf_counter=lambda: watch.now))
    return time_case(SimpleNamespace(build=build), SCENE, "any", dt, {}, 1.0)


def test_a_fixed_step_costs_the_median_of_its_samples(monkeypatch):
    """Samples of 10 steps: 1.2, 1.1, 1.4, 1.3 and 1.5 ms a step, in the middle 1.3, from 1.1 to 1.5; 100 in all."""
    found = timed(monkeypatch, Run, 0.01)
    assert found.step_us == pytest.approx(1300.0)
    assert found.spread == pytest.approx(0.4 / 1.3)
    assert (found.build_s, found.first_call_s) == pytest.approx((2.0, 3e-3))
    assert found.run_s == pytest.approx(0.13)


class Calling(Run):
    """A call takes 8 ms, whatever it is for, and a step 0.03 ms: an engine that is compiled for many steps."""

    def advance(self, steps):
        self._watch.now += 8e-3 + 3e-5 * steps


def test_where_a_call_costs_more_than_its_steps_these_are_timed(monkeypatch):
    found = timed(monkeypatch, Calling, 1e-4)
    assert 30.0 < found.step_us < 45.0


def test_a_run_of_one_step_costs_that_step(monkeypatch):
    """25 ms, as slow as the samples are, whether one step is told or none."""
    for told in (1, 0):

        class Single(Whole):
            def advance_to(self, time, told=told):
                super().advance_to(time)
                return told

        found = timed(monkeypatch, Single, None)
        assert (found.steps, found.step_us) == (1, pytest.approx(25 * 1300.0))


def test_a_chosen_step_costs_its_share_of_the_whole_run(monkeypatch):
    """Whole runs of 25 steps, as slow as these."""
    found = timed(monkeypatch, Whole, None)
    assert found.step_us == pytest.approx(1300.0)
    assert found.spread == pytest.approx(0.4 / 1.3)
    assert (found.build_s, found.run_s) == pytest.approx((2.0, 25 * 1.3e-3))
    assert found.first_call_s == pytest.approx(25 * 3e-3 * 1e-6)  # of the first run, for a millionth of the time
    assert found.steps == 25


@pytest.mark.parametrize(("slowness", "steps", "runs"), [(0.3, 33, 2), (0.0005, 100, 100), (20.0, 1, 1)])
def test_a_sample_is_as_many_runs_as_fill_it_and_a_hundred_at_most(monkeypatch, slowness, steps, runs):
    """A sample takes 10 ms. Of 0.3 ms, 16 steps take 4.8 ms, so 33 do nearly fill it; two such runs are enough.

    Of 0.5 us, all 100 steps do not fill it, nor do a hundred runs; one of 20 ms does.
    """
    watch, built = SimpleNamespace(now=0.0), []

    def build(*_, **__):
        built.append(Run(watch, slowness))
        return built[-1]

    monkeypatch.setattr(clock, "time", SimpleNamespace(perf_counter=lambda: watch.now))
    found = time_case(SimpleNamespace(build=build), SCENE, "any", 0.01, {}, 1.0)
    assert found.step_us == pytest.approx(1e3 * slowness)
    assert found.steps == pytest.approx(steps * runs)
    assert len(built) == 2 + 5 * runs


@pytest.mark.parametrize(("slowness", "runs"), [(0.03, 14), (0.001, 100)])
def test_a_sample_of_whole_runs_is_as_many_as_fill_it_and_a_hundred_at_most(monkeypatch, slowness, runs):
    """Of 0.75 ms, 14 runs fill the 10 ms of a sample; of 25 us, a hundred do not."""
    watch, built = SimpleNamespace(now=0.0), []

    def build(*_, **__):
        built.append(Whole(watch, slowness))
        return built[-1]

    monkeypatch.setattr(clock, "time", SimpleNamespace(perf_counter=lambda: watch.now))
    found = time_case(SimpleNamespace(build=build), SCENE, "any", None, {}, 1.0)
    assert found.step_us == pytest.approx(1e3 * slowness)
    assert found.run_s == pytest.approx(25e-3 * slowness)
    assert len(built) == 1 + 5 * runs


def ticking(monkeypatch, kind, slowness=1.0):
    """An engine of such runs, and the clock that they wind."""
    watch = SimpleNamespace(now=0.0)
    clocks = SimpleNamespace(
        process_time=lambda: watch.now, thread_time=lambda: watch.now, perf_counter=lambda: watch.now
    )
    monkeypatch.setattr(clock, "time", clocks)
    return SimpleNamespace(build=lambda *_, **__: kind(watch, slowness)), watch


class Slowing:
    """Its k-th step takes k ms, and reading its state 0.5 ms."""

    def __init__(self, watch, _):
        self._watch, self._taken = watch, 0

    def advance(self, steps):
        assert steps == 1
        self._taken += 1
        self._watch.now += 1e-3 * self._taken

    def state(self):
        self._watch.now += 0.5e-3

    def health(self):
        return None


class SlowingWhole:
    """The same for one that chooses its steps: it is asked for the ends of intervals of 0.25 s."""

    def __init__(self, watch, slowness):
        self._inner, self._asked = Slowing(watch, slowness), 0.0
        self.state, self.health = self._inner.state, self._inner.health

    def advance_to(self, time):
        assert time == self._asked + 0.25
        self._asked = time
        self._inner.advance(1)


@pytest.mark.parametrize(("kind", "dt"), [(Slowing, 0.01), (SlowingWhole, None)])
def test_a_step_and_a_reading_cost_the_median_of_all_but_the_first_tenth(monkeypatch, kind, dt):
    """Of 200, the steps 21 to 200: in the middle 110.5 ms, and 0.5 ms for the reading."""
    engine, _ = ticking(monkeypatch, kind)
    assert time_each_step(engine, SCENE, "any", dt, {}, 0.25) == pytest.approx(111e3)


FAULT = Fault("warned", "wobbly")


class Racing:
    """A step, or 0.01 s, takes what the test says, s; it says that something is wrong once it is `ill` s old."""

    def __init__(self, watch, costs):
        self._watch, (self._cost, self._ill), self.age = watch, costs, 0.0

    def advance(self, steps):
        self.age += 0.01 * steps
        self._watch.now += steps * self._cost

    def state(self):
        self._watch.now += 5.0  # reading is not timed
        return self.age

    def health(self):
        return FAULT if self.age > self._ill else None


class RacingWhole:
    """The same for one that chooses its steps."""

    def __init__(self, watch, costs):
        self._inner = Racing(watch, costs)
        self.state, self.health = self._inner.state, self._inner.health

    def advance_to(self, time):
        self._inner.advance(round((time - self._inner.age) / 0.01))


TENTHS = 0.1 * np.arange(1, 11)


@pytest.mark.parametrize(("kind", "dt"), [(Racing, 0.01), (RacingWhole, None)])
@pytest.mark.parametrize(
    ("cost", "ill", "lost_at", "expected"),
    [
        (0.005, 9.0, 9.0, Race(1.0, 0.5, lost=False)),  # 100 steps of 5 ms
        (0.01, 9.0, 9.0, Race(1.0, 1.0, lost=False)),
        (0.03, 9.0, 9.0, Race(0.4, 1.2, lost=False)),  # at 0.3 s it is 0.9 s, and 1.2 s at the next
        (0.005, 0.45, 9.0, Race(0.5, 0.25, lost=True, fault=FAULT)),
        (0.005, 9.0, 0.65, Race(0.7, 0.35, lost=True)),
    ],
)
def test_a_race_goes_to_the_end_or_until_it_is_late_or_lost(monkeypatch, kind, dt, cost, ill, lost_at, expected):
    engine, _ = ticking(monkeypatch, kind, (cost, ill))
    found = race(engine, SCENE, "any", dt, {}, TENTHS, lambda _, age: age > lost_at)
    assert found[:2] == pytest.approx(expected[:2])
    assert found[2:] == expected[2:]


def test_a_race_takes_the_steps_up_to_each_time_and_says_which_it_is(monkeypatch):
    """Steps of 0.3 s: two to 0.6 s, and three more to 1.5 s."""
    seen: list[tuple[float, float]] = []
    engine, _ = ticking(monkeypatch, Racing, (0.1, 9.0))
    found = race(engine, SCENE, "any", 0.3, {}, np.array([0.6, 1.5]), lambda *each: bool(seen.append(each)))
    assert found[:2] == pytest.approx((1.5, 0.5))
    assert seen == [pytest.approx((0.6, 0.02)), pytest.approx((1.5, 0.05))]


@pytest.mark.parametrize(("own", "spent"), [(0.0095, 0.95), (0.005, 1.0), (0.0, 1.0)])
def test_other_threads_count_in_a_race_and_ticks_do_not(monkeypatch, own, spent):
    """100 steps of 10 ms of the process, of which the thread had so much."""
    engine, watch = ticking(monkeypatch, Racing, (0.01, 9.0))
    monkeypatch.setattr(clock.time, "thread_time", lambda: own / 0.01 * watch.now)
    assert race(engine, SCENE, "any", 0.01, {}, TENTHS, lambda *_: False).spent == pytest.approx(spent)


def test_the_thread_that_works_beside_is_one_of_ours_in_a_race(monkeypatch):
    """100 steps of 10 ms of the process, of which this thread had 6 and the other 3.5."""
    engine, watch = ticking(monkeypatch, Racing, (0.01, 9.0))
    monkeypatch.setattr(clock.time, "thread_time", lambda: 0.6 * watch.now)
    monkeypatch.setattr(clock, "spent_beside", lambda: 0.35 * watch.now)
    assert race(engine, SCENE, "any", 0.01, {}, TENTHS, lambda *_: False).spent == pytest.approx(0.95)


def test_a_call_is_timed_by_the_processor(monkeypatch):
    ticks = iter([3.0, 3.5])
    monkeypatch.setattr(clock, "time", SimpleNamespace(process_time=lambda: next(ticks)))
    assert timed_call(lambda: "value") == ("value", 0.5)
