"""No wait of the main thread is one that a signal makes endless."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from studyrunner.system.mailbox import Mailbox

ROOT = Path(__file__).parents[2]

BUSY = """
import ctypes, os, queue, signal, subprocess, sys, threading, time
from studyrunner.system.mailbox import Mailbox

def hold():
    # lets others in between, long enough for the main thread to wait, and keeps them out past its deadline
    while True:
        ctypes.PyDLL(None).usleep(200_000)
        time.sleep(0.1)

came = []
signal.signal(signal.SIGUSR1, lambda *_: came.append(1))
signal.signal(signal.SIGALRM, signal.SIG_DFL)
signal.alarm(15)
threading.Thread(target=hold, daemon=True).start()
send = f"import os, time\\nfor _ in range(200): os.kill({os.getpid()}, 10); time.sleep(0.0137)"
sender = subprocess.Popen([sys.executable, "-c", send])
if sys.argv[1] == "mailbox":
    wait = Mailbox().wait
else:
    empty = queue.SimpleQueue()
    def wait(seconds):
        try:
            empty.get(timeout=seconds)
        except queue.Empty:
            pass
while sender.poll() is None:
    wait(0.05)
print("waited", len(came) > 5, flush=True)
os._exit(0)
"""


def busy(how: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", BUSY, how], cwd=ROOT, capture_output=True, text=True, timeout=100, check=False
    ).stdout


def test_a_wait_that_signals_interrupt_past_its_deadline_ends() -> None:
    assert busy("mailbox") == "waited True\n"


@pytest.mark.slow
@pytest.mark.skipif(sys.version_info >= (3, 12), reason="may be mended in later versions")
def test_one_of_python_does_not_which_is_why_it_is_not_used() -> None:
    assert busy("queue") == ""


def test_messages_come_in_their_order_and_stay_until_they_are_taken() -> None:
    box: Mailbox[int] = Mailbox()
    box.wait(0.0)
    assert box.first() is None
    assert box.take() is None
    for number in (1, 2, 3):
        box.put(number)
    box.wait(100.0)
    assert [box.first(), box.take(), box.take(), box.first(), box.take(), box.take()] == [1, 1, 2, 3, 3, None]
