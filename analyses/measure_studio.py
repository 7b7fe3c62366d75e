"""How soon does the studio answer a slider, and do ten open pages block each other?

Starts `wm-drake studio`, moves one slider 200 times with the arrows of seven numbers, then lets ten
pages move at the same time. The wall time on a busy computer is longer than the CPU time.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np

KEY, UNIT, LOW, HIGH = "gasket.stiffness_x", "N/mm", 1.6, 6.2
LIMIT = 0.1  # s: 95 % of the answers must come in this time


def asked(address: str, path: str, body: dict[str, Any]) -> dict[str, Any]:
    """Return the answer of the server to a request."""
    headers = {"Content-Type": "application/json"}
    request = urllib.request.Request(f"{address}api/{path}", json.dumps(body).encode(), headers)
    with urllib.request.urlopen(request) as response:
        return dict(json.load(response))


def moved(address: str, page: str, keys: list[str], count: int) -> np.ndarray:
    """Return wall and CPU time of the server, and the wait of the page, of each move. [s]"""
    times = []
    for share in np.linspace(0.0, 1.0, count):
        values = {KEY: f"{LOW + share * (HIGH - LOW):.6f} {UNIT}"}
        state = {"machine": "reference", "load": "middle", "values": values}
        begin = time.perf_counter()
        answer = asked(address, "run", {"page": page, "state": state, "keys": keys})
        spent = answer["server_s"]
        times.append((spent["wall"], spent["cpu"], time.perf_counter() - begin))
    return np.array(times)


def measured(address: str, moves: int, pages: int) -> list[str]:
    """Return the lines of the result."""
    state = {"machine": "reference", "load": "middle"}
    moved(address, "warm", [], 2)  # compiles
    arrows = asked(address, "ranking", {"page": "warm", "state": state})["arrows"]
    arrows.sort(key=lambda arrow: -max(map(abs, arrow["amplitude"])))
    keys = [arrow["key"] for arrow in arrows[:7]]
    one = moved(address, "one", keys, moves)
    lines = [f"{moves} moves of one slider, 70 s run, default step, arrows of 7 numbers:"]
    for name, column in zip(("wall time", "CPU time"), one.T, strict=False):
        middle, high = 1e3 * np.quantile(column, (0.5, 0.95))
        within = 100.0 * np.mean(column <= LIMIT)
        lines.append(
            f"  {name} of the server: median {middle:.0f} ms, 95 % within {high:.0f} ms; "
            f"{within:.0f} % within {1e3 * LIMIT:.0f} ms"
        )
    found: list[np.ndarray] = []
    threads = [
        threading.Thread(target=lambda p=f"page {n}": found.append(moved(address, p, keys, 10)))
        for n in range(pages)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    waits = np.concatenate(found)[:, 2]
    lines.append(
        f"{pages} pages that move without a pause: a page waits {1e3 * np.median(waits):.0f} ms "
        f"(median), {1e3 * np.max(waits):.0f} ms at most"
    )
    return lines


def main() -> None:
    """Print the times and write them to a file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="five moves and two pages")
    parser.add_argument("--out", type=Path, help="also write the lines to this file")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "wm_drake", "studio", "--no-browser", "--folder", folder]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert server.stdout is not None
        try:
            address = server.stdout.readline().split()[-1]
            text = "\n".join(measured(address, *((5, 2) if arguments.quick else (200, 10))))
        finally:
            server.terminate()
            server.wait()
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
