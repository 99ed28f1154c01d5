"""The command `hydrograd`, also `python -m hydrograd`."""

import signal
import sys

from hydrograd._hydrograd import _command
from hydrograd._viewer.recording import Command


def main() -> int:
    """Runs the command line of this process; its exit code."""
    # Nothing of Python runs meanwhile that could raise KeyboardInterrupt.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.stdout.flush()
    return _command(["hydrograd", *sys.argv[1:]], Command)


if __name__ == "__main__":
    sys.exit(main())
