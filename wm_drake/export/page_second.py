"""An export compiles in two processes; this module is the second one.

It starts with the export, so that its modules are there when the plan of the functions is known.
What it compiles reaches the first process through the files of compiled code: if it fails or is
ended, nothing is lost but time.
"""

import contextlib
import os
import pickle
import subprocess
import sys
import threading
from typing import Any

import numpy as np

from wm_drake.compiler.compilation import CACHE_FOLDER
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.linear import is_followed
from wm_drake.export.page_kernel import MEANWHILE, page_code


class SecondProcess:
    """A process that compiles functions of a page; none on one core or without a cache."""

    def __enter__(self) -> "SecondProcess":
        """Start it."""
        self._process: subprocess.Popen[bytes] | None = None
        if CACHE_FOLDER and (os.cpu_count() or 1) > 1:
            with contextlib.suppress(OSError):
                self._process = subprocess.Popen(
                    [sys.executable, "-m", __name__],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
        return self

    def compile(self, plan: Any) -> None:
        """Let it compile the functions `MEANWHILE` of a plan."""
        if self._process is None or self._process.stdin is None:
            return
        # an element of a script of the user cannot be sent: the first process compiles it
        with contextlib.suppress(OSError, pickle.PicklingError, AttributeError, TypeError):
            self._process.stdin.write(pickle.dumps(plan))
            self._process.stdin.flush()
            return
        self._end()

    def wait(self) -> None:
        """Wait until it has ended."""
        if self._process is not None:
            self._process.wait()

    def __exit__(self, *error: object) -> None:
        """End it if it still runs, also after Ctrl-C."""
        self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()


def end_with_the_first() -> None:
    """End this process when the first one has ended."""
    os.read(sys.stdin.fileno(), 1)  # it sends nothing more
    os._exit(1)


if __name__ == "__main__":
    is_followed(np.zeros((WIDTH, 1, 1)), np.zeros(1, dtype=int), 1.0)  # for any machine
    sent = pickle.load(sys.stdin.buffer)
    threading.Thread(target=end_with_the_first, daemon=True).start()
    page_code(sent, MEANWHILE)
