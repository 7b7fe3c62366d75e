"""Blocks of drawn machines in a ledger: each is drawn by a random generator of its own."""

import numpy as np

from analysis_tools.machine_net import LAWS, Net, Scored, free_of_net
from wm_drake.batch.ledger import Ledger, LedgerEntry, key_of
from wm_drake.parameters.types import FloatArray

BLOCK = 16
"""Machines of a block; all of one have the same damper law."""

PASSED = 0.05
"""Fraction of the machines that make the gasket study."""


def identity_of(seed: int) -> dict[str, str]:
    """Return the texts that identify the net; a change of the program does not end it."""
    return {
        "study": "net",
        "seed": str(seed),
        "priors": key_of(free={law: free_of_net(law) for law in LAWS}, block=BLOCK)[:8],
    }


def block_of(ledger: Ledger, seed: int, number: int) -> Scored:
    """Return a block of the ledger."""
    return Scored(**ledger.get(key_of(seed=seed, block=number)).values)


def ranked(ledger: Ledger, seed: int) -> list[tuple[float, int, int]]:
    """Return score, block and place of the machines with a second score, best first."""
    return sorted(
        (float(scored.first[place] + scored.second[place]), number, int(place))
        for number in range(len(ledger))
        for scored in [block_of(ledger, seed, number)]
        for place in np.flatnonzero(np.isfinite(scored.second))
    )


def law_of(number: int) -> str:
    """Return the damper law of a block."""
    return LAWS[number % len(LAWS)]


def add_block(
    ledger: Ledger, nets: dict[str, Net], seed: int, number: int, size: int = BLOCK
) -> None:
    """Draw and score a block of machines, and store it.

    Args:
        nets: Nets by damper law, built when they are needed.
        number: Number of the block; those before it must be in the ledger.
        size: Number of machines.
    """
    law = law_of(number)
    if law not in nets:
        nets[law] = Net(law)
    net = nets[law]
    rng = np.random.default_rng([seed, number])
    scored = net.scored(np.array([net.drawn(rng) for _ in range(size)]))
    limit = _limit(ledger, seed, number, scored.first)
    chosen = np.flatnonzero(scored.first <= limit)
    scored = net.with_second_stage(scored, chosen)
    values = {name: np.asarray(value, dtype=float) for name, value in vars(scored).items()}
    ledger.put_all({key_of(seed=seed, block=number): LedgerEntry(values)})


def _limit(ledger: Ledger, seed: int, number: int, first: FloatArray) -> float:
    """Return the first score below which a machine makes the gasket study."""
    before = [block_of(ledger, seed, k).first for k in range(max(0, number - 200), number)]
    return float(np.nanquantile(np.concatenate([*before, first]), PASSED))
