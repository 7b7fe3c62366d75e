"""Which machines have the shape of the results of [B], from anywhere in the priors?

A search by slopes stays in the basin where it starts. This script draws machines from the wide
priors of reference_net.yaml, with four damper laws in turn, and scores each by shape: signs and
order of effects, changes by the gasket, and which resonance holds the largest Dz of the middle load
(there Dz grows with K_Lx and falls with K_Lz). A machine whose first score, of twelve runs, is
among the best of those before it also makes the gasket study of 27 trials. fit_basins.py goes on
from the best.

Machines are drawn in blocks. Each block has a random generator of its own and is kept in a ledger,
so that a second call with the same file goes on; seed and number of blocks determine the result.

    python analyses/search_basins.py --ledger net.sqlite --minutes 120
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from analysis_tools import validation_page as page
from analysis_tools.machine_net import Net
from analysis_tools.net_ledger import BLOCK, add_block, block_of, identity_of, law_of, ranked

from wm_drake.batch.ledger import Ledger, open_ledger

SHOWN = 12
"""Machines in the table."""


def main() -> None:
    """Draw machines until the time is over, and print the best of all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one block of two machines")
    parser.add_argument("--minutes", type=float, default=60.0, help="time until it stops")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ledger", type=Path, default=Path("search_basins.sqlite"))
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    begin = time.monotonic()
    with open_ledger(arguments.ledger, identity_of(arguments.seed), resume=True) as ledger:
        if arguments.quick:
            add_block(ledger, {}, arguments.seed, 0, size=2)
        else:
            nets: dict[str, Net] = {}
            number = len(ledger)
            while time.monotonic() - begin < 60.0 * arguments.minutes:
                add_block(ledger, nets, arguments.seed, number)
                number += 1
                print(f"{BLOCK * number} machines", file=sys.stderr, flush=True)
        text = _table(ledger, arguments.seed)
    print(text)
    page.write(text, arguments.out, None)


def _table(ledger: Ledger, seed: int) -> str:
    order = ranked(ledger, seed)
    blocks = [block_of(ledger, seed, number) for number in range(len(ledger))]
    drawn = sum(len(block.first) for block in blocks)
    slopes = np.concatenate([block.slopes for block in blocks])
    run = sum(int(np.isfinite(block.first).sum()) for block in blocks)
    lateral = int(((slopes[:, 0] > 0.0) & (slopes[:, 1] < 0.0)).sum())
    rows = []
    for score, number, place in order[:SHOWN]:
        scored = blocks[number]
        rows.append(
            [
                f"{number}.{place}",
                law_of(number),
                f"{score:.0f}",
                f"{scored.first[place]:.0f}",
                f"{scored.signs[place]:.0f} of 12",
                f"{scored.effects[place]:.0f} of 30",
                f"{scored.slopes[place, 0]:+.2f}",
                f"{scored.slopes[place, 1]:+.2f}",
            ]
        )
    heads = ["machine", "law", "score", "first", "signs, Table 1", "signs of effects"]
    heads += ["Dz by K_Lx", "Dz by K_Lz"]
    title = (
        f"{drawn} machines drawn, {run} run, {len(order)} with a gasket study; in {lateral} the "
        "middle Dz grows with K_Lx and falls with K_Lz"
    )
    return page.table_text(title, heads, rows)


if __name__ == "__main__":
    main()
