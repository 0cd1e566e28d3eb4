"""How tests are collected and limited in time (tests/collector.py)."""
import subprocess
import sys

from collector import ROOT

IN_A_THREAD = """
import sys, threading, pytest
ends = []
thread = threading.Thread(target=lambda: ends.append(pytest.main(["-q", "-p", "no:cacheprovider", "tests/tools/test_table.py::test_mistakes"])))
thread.start()
thread.join()
sys.exit(ends[0])
"""


def test_a_worker_outside_of_the_main_thread():
    """Signals cannot be handled there: tests run all the same, without a limit of time"""
    done = subprocess.run([sys.executable, "-c", IN_A_THREAD], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "1 passed, 0 failed" in done.stdout, done.stdout + done.stderr
