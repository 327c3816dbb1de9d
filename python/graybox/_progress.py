"""Progress of long calls, and what Ctrl-C leaves."""
import sys


class Interrupted(KeyboardInterrupt):
    """Ctrl-C stopped the work; `result` is the best that was found until then."""

    def __init__(self, result):
        super().__init__("interrupted; the best so far is in .result")
        self.result = result


def _in_notebook():
    try:
        return get_ipython().__class__.__name__ == "ZMQInteractiveShell"
    except NameError:
        return False


def _is_watched():
    return sys.stderr is not None and (sys.stderr.isatty() or _in_notebook())


class Line:
    """One line that is rewritten on a terminal or in a notebook, and taken away at the end.

    `progress`: None for that, False for silence, True for the line wherever stderr leads, or a
    callable that gets each line. Called first when there is something to show, half a second on.
    """

    def __init__(self, progress=None):
        self._progress = progress
        self._width = 0

    def __call__(self, line):
        if self._progress is None:
            self._progress = _is_watched()
        if self._progress is True:
            sys.stderr.write("\r" + line.ljust(self._width))
            sys.stderr.flush()
            self._width = len(line)
        elif self._progress:
            self._progress(line)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self._width:
            sys.stderr.write("\r" + " " * self._width + "\r")
            sys.stderr.flush()


def finished(result, interrupted):
    """The result, or Interrupted with it."""
    if interrupted:
        raise Interrupted(result)
    return result
