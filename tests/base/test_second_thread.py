"""A thread beside the one that asks: both work at the same time, and neither leaves the other alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

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
import os
from pendbench.base.second_thread import both

both(abs, (1,), (2,))
child = os.fork()
if child == 0:
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
    """What lasts a while in the second thread; here it raises at once."""

    def __init__(self, error):
        self.error, self.done, self.begun = error, False, threading.Event()

    def __call__(self, here):
        if here:
            assert self.begun.wait(LONG)
            raise self.error
        self.begun.set()
        time.sleep(0.2)
        self.done = True


@pytest.mark.parametrize("error", [ValueError("here"), KeyboardInterrupt()])
def test_who_fails_here_waits_for_the_other(error):
    work = Work(error)
    with pytest.raises(type(error)):
        both(work, (True,), (False,))
    assert work.done
    assert both(abs, (-1,), (-2,)) == (1, 2)


def test_what_fails_there_is_raised_here():
    def kernel(x):
        return 1.0 / x

    with pytest.raises(ZeroDivisionError):
        both(kernel, (1.0,), (0.0,))
    assert both(kernel, (1.0,), (2.0,)) == (1.0, 0.5)


def test_an_interrupt_while_waiting_is_raised_when_the_other_is_done():
    done = []

    def kernel(here):
        if not here:
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
            time.sleep(0.2)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        both(kernel, (True,), (False,))
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

    def spend(seconds):
        until = time.thread_time() + seconds
        while time.thread_time() < until:
            pass

    both(spend, (0.0,), (0.05,))
    assert 0.05 <= spent_beside() - before < 0.06
