"""A thread beside the one that asks: both work at the same time, and neither leaves the other alone."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor

import pytest

from pendbench.base import second_thread
from pendbench.base.second_thread import both, spent_beside

LONG = 60.0  # s, after which something hangs

# The main thread ends; what it started goes on, and asks for a second thread after that.
OUTLIVING = """
import threading
from pendbench.base.second_thread import both

def work():
    threading.main_thread().join()
    print(both(lambda x: 2 * x, (1,), (2,)))

both(abs, (1,), (2,))
threading.Thread(target=work).start()
"""

# A process that has used its second thread, and another that comes from it by a fork.
FORKED = """
import os, signal
from pendbench.base.second_thread import both

both(abs, (1,), (2,))
child = os.fork()
if child == 0:
    signal.alarm(30)  # it is to fail, not to hang
    os._exit(0 if both(abs, (-3,), (-4,)) == (3, 4) else 1)
raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_both_work_at_the_same_time():
    meeting = threading.Barrier(2, timeout=LONG)
    names = both(lambda: meeting.wait() >= 0 and threading.current_thread().name, (), ())
    assert names[1] == "pendbench-second" != names[0]


def test_each_has_its_own_arguments_and_result():
    assert both(lambda x, y: x - y, (5, 2), (1, 9)) == (3, -8)


class Work:
    """What begins in the second thread before it goes on here."""

    def __init__(self, here, there):
        self.parts, self.begun, self.done = {True: here, False: there}, threading.Event(), False

    def __call__(self, here):
        if here:
            assert self.begun.wait(LONG)
            return self.parts[here]()
        self.begun.set()
        self.parts[here]()
        self.done = True
        return threading.current_thread().name


def failing(error):
    def fail():
        raise error

    return fail


@pytest.mark.parametrize("error", [ValueError("here"), KeyboardInterrupt()])
def test_who_fails_here_waits_for_the_other(error):
    work = Work(failing(error), lambda: time.sleep(0.2))
    with pytest.raises(type(error)):
        both(work, (True,), (False,))
    assert work.done
    assert both(abs, (-1,), (-2,)) == (1, 2)


def test_what_nobody_began_is_left_where_the_other_fails():
    """The second thread is busy until later, and finds nothing to do then."""
    busy, free, done = threading.Event(), threading.Event(), []

    def occupied(here):
        if here:
            assert busy.wait(LONG)
        else:
            busy.set()
            assert free.wait(LONG)

    def fail(here):
        if not here:
            done.append(here)
        raise ValueError("here")

    other = threading.Thread(target=both, args=(occupied, (True,), (False,)))
    other.start()
    assert busy.wait(LONG)
    with pytest.raises(ValueError, match="here"):
        both(fail, (True,), (False,))
    free.set()
    other.join(LONG)
    assert both(abs, (-1,), (-2,)) == (1, 2)
    assert not done


def test_where_the_other_has_not_begun_this_one_does_both():
    busy, free = threading.Event(), threading.Event()

    def occupied(here):
        assert busy.wait(LONG) if here else (busy.set() or free.wait(LONG))

    other = threading.Thread(target=both, args=(occupied, (True,), (False,)))
    other.start()
    assert busy.wait(LONG)
    here = threading.current_thread().name
    assert both(lambda: threading.current_thread().name, (), ()) == (here, here)
    free.set()
    other.join(LONG)


def test_several_at_once_share_one():
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda x: both(lambda y: y * y, (x,), (-2 * x,)), range(500)))
    assert found == [(x * x, 4 * x * x) for x in range(500)]
    assert sum(thread.name == "pendbench-second" for thread in threading.enumerate()) == 1


def test_nothing_of_what_was_done_is_kept():
    class Large:
        pass

    argument = Large()
    kept, work = weakref.ref(argument), Work(lambda: None, lambda: None)
    both(lambda here, _: work(here), (True, None), (False, argument))
    del argument
    assert both(abs, (-1,), (-2,)) == (1, 2)  # by then the second thread waits again
    deadline = time.monotonic() + LONG
    while kept() is not None and time.monotonic() < deadline:
        gc.collect()
    assert kept() is None


def test_what_fails_there_is_raised_here():
    def kernel(x):
        return 1.0 / x

    with pytest.raises(ZeroDivisionError):
        both(kernel, (1.0,), (0.0,))
    assert both(kernel, (1.0,), (2.0,)) == (1.0, 0.5)


@pytest.fixture
def interrupts():
    """As they are by default, whatever started the tests."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interrupts")
def test_an_interrupt_while_waiting_is_raised_when_the_other_is_done():
    def interrupt():
        time.sleep(0.1)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        time.sleep(0.2)

    work = Work(lambda: None, interrupt)
    with pytest.raises(KeyboardInterrupt):
        both(work, (True,), (False,))
    assert work.done


@pytest.mark.usefixtures("interrupts")
def test_an_interrupt_as_work_is_handed_over_leaves_nobody_at_work(monkeypatch):
    begun, done, hand_over = threading.Event(), [], second_thread._Home.do

    def do(self, task):
        hand_over(self, task)
        assert begun.wait(LONG)
        signal.raise_signal(signal.SIGINT)

    def kernel():
        begun.set()
        time.sleep(0.3)
        done.append(True)

    monkeypatch.setattr(second_thread._Home, "do", do)
    with pytest.raises(KeyboardInterrupt):
        both(kernel, (), ())
    assert done


def test_a_thread_that_outlives_the_main_one_has_it_too():
    done = subprocess.run([sys.executable, "-c", OUTLIVING], capture_output=True, text=True, timeout=LONG, check=False)
    assert (done.stdout.strip(), done.stderr) == ("(2, 4)", "")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_forked_process_has_one_of_its_own():
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, timeout=LONG, check=False)
    assert done.returncode == 0, done.stderr


def test_its_processor_time_is_known():
    before = spent_beside()

    def spend():
        until = time.thread_time() + 0.05
        while time.thread_time() < until:
            pass

    both(Work(lambda: None, spend), (True,), (False,))
    assert 0.05 <= spent_beside() - before < 0.06
