"""Run the command `wm-drake`, so that closed streams and Ctrl-C lose nothing.

This is the first line of the package that runs. The start of Python itself lies before it: Ctrl-C
there (some 20 ms) ends with a traceback of Python, which nothing here can prevent.
"""

import errno
import io
import os
import signal
import sys
from types import FrameType
from typing import Any

RETRY = 0.05
"""Time after which an interrupt that had no effect is tried again. [s]"""

INTERRUPTED = 130
"""Exit code after Ctrl-C."""


class LastingStream(io.FileIO):
    """Standard stream after whose end the command goes on: its reader left, or its disk is full.

    Attributes:
        fault: The error that ended it; None while text arrives.
    """

    fault: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write bytes, or drop them once the stream has ended."""
        if self.fault is None:
            try:
                return super().write(data)
            except OSError as error:
                self.fault = error
        return len(memoryview(data))


def lasting(stream: Any, number: int) -> tuple[io.TextIOWrapper, LastingStream]:
    """Return a text stream to a file number in place of a standard one, and what is below it."""
    raw = LastingStream(number, "w", closefd=False)
    encoding, errors = getattr(stream, "encoding", "utf-8"), getattr(stream, "errors", "replace")
    is_by_line = getattr(stream, "line_buffering", True)
    text = io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors, line_buffering=is_by_line)
    return text, raw


def open_streams() -> LastingStream:
    """Make standard output and error lasting, and return what is below the first.

    Numbers of closed streams become those of the null device: the next file that is opened, such as
    a ledger, would get them, and with them all that is printed.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    sys.stderr, _ = lasting(sys.stderr, 2)
    sys.stdout, raw = lasting(sys.stdout, 1)
    return raw


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, but not within an import, and again as long as it is not handled.

    Libraries swallow it in imports or make other errors of it: pydrake and pydantic do. C code and
    Python itself ignore errors in some places, such as callbacks and comparisons of keys.
    """
    signal.setitimer(signal.ITIMER_REAL, RETRY, RETRY)
    if number == signal.SIGALRM and is_interrupted(sys.exc_info()[1]):
        return
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib."):
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def is_interrupted(error: BaseException | None) -> bool:
    """Return whether an error is an interrupt, or came of one."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _unraisable(ignored: Any) -> None:
    """Report an error that Python ignores, unless it is an interrupt, which is tried again."""
    if not is_interrupted(ignored.exc_value):
        sys.__unraisablehook__(ignored)


def _end_at_once(number: int, frame: FrameType | None) -> None:
    """End at an interrupt while Python ends."""
    del number, frame
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


def guard_interrupts() -> None:
    """Handle Ctrl-C by `interrupt`, unless this process was started to ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
        signal.signal(signal.SIGALRM, interrupt)
        sys.unraisablehook = _unraisable


def main() -> None:
    """Run the command, and end with its exit code."""
    guard_interrupts()
    out = open_streams()
    code: Any = 0
    try:
        from wm_drake.cli import main as command

        command()
    except SystemExit as end:
        code = end.code
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        code = INTERRUPTED
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    if signal.getsignal(signal.SIGINT) is interrupt:
        signal.signal(signal.SIGINT, _end_at_once)
    sys.stdout.flush()
    if out.fault is not None and out.fault.errno != errno.EPIPE:
        sys.stderr.write(f"standard output: {os.strerror(out.fault.errno or 0)}\n")
        code = code or 2
    sys.exit(code)


if __name__ == "__main__":
    main()
