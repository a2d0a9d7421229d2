"""Wall time from the user's point of view: from the start of the process, or from the call."""

import subprocess
import sys
import time

from rsibr import clock


def test_a_block_counts_from_its_beginning_and_all_that_it_calls_does_too():
    before = time.perf_counter()
    with clock.counting() as begun:
        assert before <= begun <= time.perf_counter()
        with clock.counting() as inner:
            assert inner == begun == clock.waiting_since()
        with clock.counting(begun - 5) as earlier:
            assert clock.waiting_since() == earlier == begun - 5
        assert clock.waiting_since() == begun
    assert clock.waiting_since() > begun


def test_a_process_that_was_started_for_a_command_counts_from_its_start():
    """Half a second before the first import is part of what the user waits for."""
    code = "import time; time.sleep(0.5); from rsibr import clock; print(time.perf_counter() - clock.command_start())"
    start = time.perf_counter()
    told = float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
    assert 0.5 <= told <= time.perf_counter() - start + 0.05  # the system counts in hundredths of a second


def test_python_that_has_run_for_a_while_is_asked_for_a_command_only_now():
    assert time.perf_counter() - clock.command_start(imported=time.perf_counter() - 60) < 1


def test_start_up_is_told_only_to_who_waits_since_the_process_started(monkeypatch):
    monkeypatch.setattr(clock, "_ready", [clock.process_start() + 1.5])
    with clock.counting(clock.process_start()):
        told = clock.start_up_seconds()
        assert told is not None
        assert abs(told - 1.5) < 0.1
    with clock.counting(clock.process_start() + 10):
        assert clock.start_up_seconds() is None
