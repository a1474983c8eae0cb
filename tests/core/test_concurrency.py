"""Several fits at once: answers in order, the first error, and Ctrl-C that waits for none of them."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from functools import partial

import pytest
from bevameter.framework.core.concurrency import together

_LONG = """
import os, time
from bevameter.framework.core.concurrency import together
def call(seconds):
    os.write(1, b"begun\\n")  # whole, for two threads write
    time.sleep(seconds)
together(call, [60.0, 60.0])
"""


def test_answers_come_in_order_and_errors_are_raised():
    assert together(lambda each: each**2, [3, 1, 2]) == [9, 1, 4]
    with pytest.raises(ZeroDivisionError):
        together(lambda each: 1 / each, [1, 0])


def test_ctrl_c_waits_for_no_call():
    # a shell's background job ignores SIGINT, and so would what it starts
    listens = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen([sys.executable, "-P", "-c", _LONG], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                               text=True, preexec_fn=listens)  # fmt: skip
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) != 0  # the calls take twice as long
    finally:
        process.kill()


def test_calls_within_calls_take_no_more_threads():
    def nested(value):
        return {threading.get_ident()} | set(together(lambda _: threading.get_ident(), range(4)))

    assert all(len(threads) == 1 for threads in together(nested, range(2)))
