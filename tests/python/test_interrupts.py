"""Ctrl-C, progress and the interpreter's lock in long calls."""
import os
import signal
import threading
import time
import unittest

import numpy as np

import graybox
from sets import cubic, random_set


def slow(**keywords):
    """Takes far longer than any test waits."""
    return graybox.solve(cubic(20001), solver="multiplicative", gap=1e-9,
                         iteration_limit=10**9, **keywords)


def after(seconds, act):
    timer = threading.Timer(seconds, act)
    timer.start()
    return timer


class Interrupts(unittest.TestCase):
    def test_ctrl_c_hands_over_the_best_so_far(self):
        after(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt) as stopped:
            slow()
        self.assertLess(time.monotonic() - start, 10)
        self.assertIsInstance(stopped.exception, graybox.Interrupted)
        result = stopped.exception.result
        self.assertIn("interrupted", result.message)
        self.assertAlmostEqual(result.weights.sum(), 1, 9)
        # The next call is not stopped by it, and Python's own handler is back.
        self.assertTrue(graybox.solve(random_set()).solved)
        with self.assertRaises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)

    def test_ctrl_c_ends_exact_designs(self):
        # The first relaxed problem takes a while, a proof to 1e-9 minutes.
        timer = after(1.5, lambda: os.kill(os.getpid(), signal.SIGINT))
        self.addCleanup(timer.cancel)
        with self.assertRaises(graybox.Interrupted) as stopped:
            graybox.exact(random_set(3000, 12, seed=8), 37, gap=1e-9)
        self.assertIn(stopped.exception.result.status, ("time_limit", "feasible"))

    def test_other_threads_run_meanwhile(self):
        counted = 0

        def count():
            nonlocal counted
            while not done.is_set():
                counted += 1
                time.sleep(0.001)
        done = threading.Event()
        counter = threading.Thread(target=count)
        counter.start()
        try:
            slow(time_limit=0.5)
        finally:
            done.set()
        counter.join()
        self.assertGreater(counted, 50)

    def test_calls_run_beside_each_other(self):
        sets = [random_set(seed=k) for k in range(4)]
        alone = [graybox.solve(each).weights for each in sets]
        together = [None] * 4

        def solve(k):
            together[k] = graybox.solve(sets[k]).weights
        threads = [threading.Thread(target=solve, args=(k,)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        np.testing.assert_array_equal(alone, together)


class Progress(unittest.TestCase):
    def test_lines_come_a_few_times_a_second(self):
        lines = []
        slow(time_limit=1.5, progress=lines.append)
        self.assertGreaterEqual(len(lines), 2)
        self.assertLessEqual(len(lines), 10)
        self.assertRegex(lines[0], r"^multiplicative: iteration \d+, gap ")

    def test_short_calls_are_silent(self):
        lines = []
        graybox.solve(random_set(), progress=lines.append)
        self.assertEqual(lines, [])

    def test_what_a_callable_throws_comes_through(self):
        def refuse(line):
            raise RuntimeError("enough")
        with self.assertRaisesRegex(RuntimeError, "enough"):
            slow(time_limit=5, progress=refuse)

    def test_calls_within_a_call(self):
        inner = []
        slow(time_limit=1.0, progress=lambda line: inner.append(graybox.solve(random_set()).solved))
        self.assertTrue(inner and all(inner))


if __name__ == "__main__":
    unittest.main()
