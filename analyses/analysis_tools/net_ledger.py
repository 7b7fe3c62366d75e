"""The two stages of the net in a ledger: machines by their steady motion, and the best by runs.

A block of the first stage is drawn by a random generator of its own. A machine is named by block
and place in it, and drawn again where it is needed.
"""

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

import numpy as np

from analysis_tools.machine_net import LAWS, Net, free_of_net
from analysis_tools.net_score import Scored
from analysis_tools.steady_net import SteadyNet
from wm_drake.batch.ledger import Ledger, LedgerEntry, key_of
from wm_drake.parameters.types import FloatArray

BLOCK = 100
"""Machines of a block of the first stage; all of one have the same damper law."""

STUDIED = 0.1
"""Fraction of the machines of a block whose gasket study is computed in the first stage."""

AT_ONCE = 16
"""Machines that are run side by side."""

Name: TypeAlias = tuple[int, int]
"""Block and place of a machine."""


class Nets(NamedTuple):
    """Functions of both stages for one damper law."""

    by_runs: Net
    steady: SteadyNet


def nets_of(law: str) -> Nets:
    """Return the functions of both stages for a damper law."""
    net = Net(law)
    return Nets(net, SteadyNet(net.machine, net.map, net.shape))


def identity_of(seed: int) -> dict[str, str]:
    """Return the texts that identify the net; a change of the program does not end it."""
    return {
        "study": "net in two stages",
        "seed": str(seed),
        "priors": key_of(free={law: free_of_net(law) for law in LAWS}, block=BLOCK)[:8],
    }


def law_of(block: int) -> str:
    """Return the damper law of a block."""
    return LAWS[block % len(LAWS)]


def drawn(net: Net, seed: int, block: int) -> FloatArray:
    """Return the machines of a block. (machine, quantity) [SI]"""
    rng = np.random.default_rng([seed, block])
    return np.array([net.drawn(rng) for _ in range(BLOCK)])


class TwoStages:
    """Ledger of a net.

    Attributes:
        ledger: Open ledger.
        seed: Seed of the net.
    """

    def __init__(self, ledger: Ledger, seed: int) -> None:
        """Begin with no machine built."""
        self.ledger, self.seed = ledger, seed
        self._nets: dict[str, Nets] = {}

    def nets(self, law: str) -> Nets:
        """Return the functions for a law, built when they are needed."""
        if law not in self._nets:
            self._nets[law] = nets_of(law)
        return self._nets[law]

    def block(self, number: int) -> Scored | None:
        """Return a block of the first stage, without its points; None if it is not there."""
        key = key_of(seed=self.seed, block=number)
        return Scored(**self.ledger.get(key).values) if key in self.ledger else None

    def blocks(self) -> list[Scored]:
        """Return the blocks of the first stage."""
        found: list[Scored] = []
        while (block := self.block(len(found))) is not None:
            found.append(block)
        return found

    def add_block(self, number: int, size: int = BLOCK) -> None:
        """Score a block by its steady motion, and store it."""
        nets = self.nets(law_of(number))
        scored = nets.steady.scored(drawn(nets.by_runs, self.seed, number)[:size])
        last = np.nanquantile(scored.first, STUDIED)
        scored = nets.steady.with_study(scored, np.flatnonzero(scored.first <= last))
        self._store(key_of(seed=self.seed, block=number), scored._replace(points=np.zeros(0)))

    def run(self, names: Iterable[Name]) -> None:
        """Score machines of one damper law by runs, and store each."""
        names = list(names)
        net = self.nets(law_of(names[0][0])).by_runs
        points = np.array([drawn(net, self.seed, block)[place] for block, place in names])
        scored = net.scored(points)
        scored = net.with_study(scored, np.flatnonzero(np.isfinite(scored.first)))
        for row, name in enumerate(names):
            of_one = Scored(*(values[row : row + 1] for values in scored))
            self._store(self._key(name), of_one)

    def found(self, name: Name) -> Scored | None:
        """Return a machine of the second stage; None if it was not run."""
        key = self._key(name)
        return Scored(**self.ledger.get(key).values) if key in self.ledger else None

    def _key(self, name: Name) -> str:
        return key_of(seed=self.seed, run=name)

    def _store(self, key: str, scored: Scored) -> None:
        values = {
            field: np.asarray(value, dtype=float) for field, value in scored._asdict().items()
        }
        self.ledger.put_all({key: LedgerEntry(values)})


def best_of(blocks: list[Scored]) -> list[tuple[float, Name]]:
    """Return score and name of the machines with both parts of a score, best first."""
    return sorted(
        (float(block.first[place] + block.second[place]), (number, int(place)))
        for number, block in enumerate(blocks)
        for place in np.flatnonzero(np.isfinite(block.first + block.second))
    )


def sample_of(blocks: list[Scored], count: int) -> list[Name]:
    """Return the first machines with a first score, whatever it is, to compare both stages."""
    names = (
        (number, int(place))
        for number, block in enumerate(blocks[: len(LAWS)])
        for place in np.flatnonzero(np.isfinite(block.first))[: count // len(LAWS)]
    )
    return list(names)


def by_law(names: Iterable[Name]) -> list[list[Name]]:
    """Return groups of at most `AT_ONCE` machines with one damper law."""
    groups: dict[str, list[Name]] = {}
    for name in names:
        groups.setdefault(law_of(name[0]), []).append(name)
    return [
        group[begin : begin + AT_ONCE]
        for group in groups.values()
        for begin in range(0, len(group), AT_ONCE)
    ]


def best_by_runs(stages: TwoStages) -> list[tuple[Name, FloatArray]]:
    """Return name and free quantities of the machines that were run, best first."""
    names = [name for _, name in best_of(stages.blocks())]
    found = {name: of for name in names if (of := stages.found(name)) is not None}
    totals = {name: float(of.first[0] + of.second[0]) for name, of in found.items()}
    order = sorted((name for name in totals if np.isfinite(totals[name])), key=totals.__getitem__)
    return [(name, found[name].points[0]) for name in order]
