"""No wait of the main thread is one that a signal makes endless."""

import subprocess
import sys
from pathlib import Path

import pytest

from studyrunner.system.mailbox import Mailbox

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]

BUSY = """
import ctypes, os, signal, subprocess, sys, threading, time
from studyrunner.system.mailbox import Mailbox

def hold():
    # lets others in between, long enough for the main thread to wait, and keeps them out past its deadline
    while True:
        ctypes.PyDLL(None).usleep(200_000)
        time.sleep(0.1)

came = []
signal.signal(signal.SIGUSR1, lambda *_: came.append(1))
signal.signal(signal.SIGALRM, signal.SIG_DFL)
signal.alarm(90)
threading.Thread(target=hold, daemon=True).start()
send = f"import os, time\\nfor _ in range(200): os.kill({os.getpid()}, 10); time.sleep(0.0137)"
sender = subprocess.Popen([sys.executable, "-c", send])
box = Mailbox()
while sender.poll() is None:
    # queue.SimpleQueue().get(timeout=0.05) never comes back from here in most runs
    box.wait(0.05)
print("waited", len(came) > 5, flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_a_wait_that_signals_interrupt_past_its_deadline_ends():
    ended = subprocess.run(
        [sys.executable, "-c", BUSY], cwd=ROOT, capture_output=True, text=True, timeout=200, check=False
    )
    assert ended.stdout == "waited True\n", ended.stderr


def test_messages_come_in_their_order_and_stay_until_they_are_taken():
    box: Mailbox[int] = Mailbox()
    box.wait(0.0)
    assert box.first() is None
    assert box.take() is None
    for number in (1, 2, 3):
        box.put(number)
    box.wait(100.0)
    assert [box.first(), box.take(), box.take(), box.first(), box.take(), box.take()] == [1, 1, 2, 3, 3, None]
