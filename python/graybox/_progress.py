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


class Line:
    """One line that is rewritten on a terminal or in a notebook, and taken away at the end.

    `progress`: None for that, False for silence, True for the line wherever stderr leads, or a
    callable that gets each line.
    """

    def __init__(self, progress=None):
        self._width = 0
        if callable(progress):
            self.show = progress
        elif progress is False or (progress is None and not self._is_watched()):
            self.show = None
        else:
            self.show = self._rewrite

    @staticmethod
    def _is_watched():
        return sys.stderr is not None and (sys.stderr.isatty() or _in_notebook())

    def _rewrite(self, line):
        sys.stderr.write("\r" + line.ljust(self._width))
        sys.stderr.flush()
        self._width = len(line)

    def __enter__(self):
        return self.show

    def __exit__(self, *_):
        if self._width:
            sys.stderr.write("\r" + " " * self._width + "\r")
            sys.stderr.flush()


def finished(result, interrupted):
    """The result, or Interrupted with it."""
    if interrupted:
        raise Interrupted(result)
    return result
