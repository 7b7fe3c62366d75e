"""Which machines have the shape of the results of [B], from anywhere in the priors?

A search by slopes stays in the basin where it starts. This script draws machines from the wide
priors of reference_net.yaml, with four damper laws in turn, and scores each by shape: signs and
order of effects, changes by the gasket, and which resonance holds the largest Dz of the middle load
(there Dz grows with K_Lx and falls with K_Lz). It does so in two stages. The first takes the motion
for a sequence of steady ones and the friction for its fundamental (`analysis_tools.steady_model`);
it needs milliseconds a machine. The second runs the best, and some machines of any score, which
show how well the first stage orders them. fit_basins.py goes on from the best.

Machines are drawn in blocks. Each block has a random generator of its own and is kept in a ledger,
so that a second call with the same file goes on; the seed and the numbers of machines and runs
determine the result.

    python analyses/search_basins.py --ledger net.sqlite --minutes 60
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from analysis_tools import validation_page as page
from analysis_tools.net_ledger import (
    BLOCK,
    Name,
    TwoStages,
    best_of,
    by_law,
    identity_of,
    law_of,
    sample_of,
)
from analysis_tools.net_score import Scored
from scipy.stats import spearmanr

from wm_drake.batch.ledger import open_ledger

SHOWN = 12
"""Machines in the table."""

SAMPLE = 48
"""Machines of any score that are run, to see how well the first stage orders machines."""


def main() -> None:
    """Draw machines, run the best until the time is over, and print the best of all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="four machines, two of them run")
    parser.add_argument("--machines", type=int, default=100_000, help="machines to draw")
    parser.add_argument("--runs", type=int, default=2_000, help="machines of the second stage")
    parser.add_argument("--minutes", type=float, default=60.0, help="time until it stops")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ledger", type=Path, default=Path("search_basins.sqlite"))
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    end = time.monotonic() + 60.0 * arguments.minutes
    with open_ledger(arguments.ledger, identity_of(arguments.seed), resume=True) as ledger:
        stages = TwoStages(ledger, arguments.seed)
        if arguments.quick:
            stages.add_block(0, size=4)
            stages.run(sample_of(stages.blocks(), 8))
        else:
            _draw(stages, arguments.machines, lambda: time.monotonic() < end)
            _run(stages, arguments.runs, lambda: time.monotonic() < end)
        text = _text(stages)
    print(text)
    page.write(text, arguments.out, None)


def _draw(stages: TwoStages, machines: int, has_time: Callable[[], bool]) -> None:
    number = len(stages.blocks())
    while number * BLOCK < machines and has_time():
        stages.add_block(number)
        number += 1
        print(f"{BLOCK * number} machines drawn", file=sys.stderr, flush=True)


def _run(stages: TwoStages, runs: int, has_time: Callable[[], bool]) -> None:
    """Run machines of any score, then the best ones, in groups of the same damper law."""
    blocks = stages.blocks()
    names = [*sample_of(blocks, SAMPLE), *(name for _, name in best_of(blocks)[:runs])]
    left = [name for name in dict.fromkeys(names) if stages.found(name) is None]
    for begin in range(0, len(left), 64):
        for group in by_law(left[begin : begin + 64]):
            if not has_time():
                return
            stages.run(group)
        print(f"{begin} of {len(left)} machines run", file=sys.stderr, flush=True)


def _text(stages: TwoStages) -> str:
    blocks = stages.blocks()
    steady = [name for _, name in best_of(blocks)]
    names = dict.fromkeys([*sample_of(blocks, SAMPLE), *steady])
    found = {name: of for name in names if (of := stages.found(name)) is not None}
    first = np.concatenate([block.first for block in blocks])
    slopes = np.concatenate([block.slopes for block in blocks])
    lines = [
        f"{len(first)} machines drawn, {np.isfinite(first).sum()} with a steady motion, "
        f"{len(steady)} of them with a gasket study; {len(found)} run.",
        f"In {int(_is_lateral(slopes).sum())} the middle Dz grows with K_Lx and falls with K_Lz "
        "(first stage).",
        *_agreement(blocks, found, sample_of(blocks, SAMPLE)),
    ]
    order = sorted(found, key=lambda name: _total(found[name]))
    rows = [_row(name, blocks, found[name]) for name in order[:SHOWN]]
    heads = ["machine", "law", "score", "first stage", "signs, Table 1", "signs of effects"]
    heads += ["Dz by K_Lx", "Dz by K_Lz"]
    return "\n".join(lines) + "\n\n" + page.table_text("The best by runs", heads, rows)


def _is_lateral(slopes: np.ndarray) -> np.ndarray:
    """Return whether Dz grows with K_Lx and falls with K_Lz. (machine,)"""
    return (slopes[:, 0] > 0.0) & (slopes[:, 1] < 0.0)


def _total(scored: Scored) -> float:
    """Return the score of one machine by runs; infinite without one."""
    return float(np.nan_to_num(scored.first[0] + scored.second[0], nan=np.inf))


def _agreement(blocks: list[Scored], found: dict[Name, Scored], sample: list[Name]) -> list[str]:
    """Return how both stages order the machines of any score, and the best ones."""
    lines = []
    for words, names in (
        ("of any score", sample),
        ("chosen as the best", [name for name in found if name not in sample]),
    ):
        for part in ("first", "second"):
            pairs = np.array(
                [
                    (getattr(blocks[number], part)[place], getattr(found[number, place], part)[0])
                    for number, place in names
                    if (number, place) in found
                ]
            ).reshape(-1, 2)
            pairs = pairs[np.isfinite(pairs).all(axis=1)]
            if len(pairs) > 2:
                rank = spearmanr(*pairs.T).statistic
                lines.append(
                    f"{words}, {part} part of the score: rank correlation of both stages "
                    f"{rank:.2f} ({len(pairs)} machines)"
                )
    return lines


def _row(name: Name, blocks: list[Scored], scored: Scored) -> list[str]:
    number, place = name
    block = blocks[number]
    return [
        f"{number}.{place}",
        law_of(number),
        f"{_total(scored):.0f}",
        f"{block.first[place] + block.second[place]:.0f}",
        f"{scored.signs[0]:.0f} of 12",
        f"{scored.effects[0]:.0f} of 30",
        f"{scored.slopes[0, 0]:+.2f}",
        f"{scored.slopes[0, 1]:+.2f}",
    ]


if __name__ == "__main__":
    main()
