"""Uncertain numbers of a machine: their distributions, and the cases of samples."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import ValidationError

from wm_drake.errors import InputError, Problem, check_known, input_error, problems_at
from wm_drake.parameters import Load, MachineParameters, Unbalance
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.variation import Change
from wm_drake.parameters.vary import LAUNDRY
from wm_drake.parameters.vary_file import Correlations, VaryFile
from wm_drake.parameters.varying import Varied, Varying, each
from wm_drake.report.formatting import shape_name
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.cases import Case
from wm_drake.studies.tolerance.distributions import (
    Joint,
    Marginal,
    lognormal,
    normal,
    triangular,
    uniform,
)

KEPT_MACHINES = 64
"""How many machines are cached; samples with the same parts follow each other."""

_LAUNDRY = {
    "laundry.mass": "mass of the laundry",
    "laundry.angle": "angle of the laundry",
    "laundry.y": "axial place of the laundry",
    "laundry.radius": "radius of the laundry",
    "laundry.second_share": "share of the second lump",
    "laundry.second_angle": "angle of the second lump",
    "laundry.second_y": "axial place of the second lump",
}
"""Numbers of the laundry in words."""


def quantity_of(varied: Varied) -> Quantity:
    """Return words and unit of a number that varies."""
    words = _LAUNDRY.get(varied.name) or shape_name(varied.name.replace(".", " "))
    return Quantity(words, varied.unit)


@dataclass(frozen=True)
class UncertainMachine:
    """A machine with uncertain numbers: samples become cases.

    Attributes:
        varying: The machine and its uncertain numbers.
        joint: Their distribution.
        case: Case of the machine without changes; its load is not used if the laundry is drawn.
    """

    varying: Varying
    joint: Joint
    case: Case
    _known: dict[tuple[float, ...], MachineParameters] = dataclasses.field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def parameters(self) -> MachineParameters:
        """The machine."""
        return self.varying.machine

    @property
    def variables(self) -> tuple[Varied, ...]:
        """Uncertain numbers."""
        return self.varying.every

    @property
    def words(self) -> dict[str, str]:
        """Words of the uncertain numbers, by name."""
        return {varied.name: quantity_of(varied).words for varied in self.variables}

    def cases(self, scores: FloatArray, first: int = 1) -> Iterator[Case]:
        """Yield the case of each sample.

        Args:
            scores: Independent standard normal scores. (n, variables)
            first: Number of the first sample, for the names of the cases.

        Raises:
            InputError: a sample is not a machine.
        """
        for number, values in enumerate(self.joint.values(scores), start=first):
            with problems_at(f"sample {number}"):
                case = self._case(f"sample {number}", values.tolist())
            yield case

    def _case(self, name: str, values: Sequence[float]) -> Case:
        pairs = list(zip(self.variables, values, strict=True))
        laundry = {v.name: x for v, x in pairs if v.is_laundry}
        parameters = self._machine_with(tuple(x for v, x in pairs if not v.is_laundry))
        load = laundry_load(laundry) if laundry else parameters.loads[self.case.name]
        return Case(name, load, self.case.profile, parameters=parameters)

    def _machine_with(self, values: tuple[float, ...]) -> MachineParameters:
        """Return the machine with values of its own numbers, the same one for the same values.

        The samples of Sobol indices exchange one number at a time: half of their machines differ in
        the laundry only, and each machine is prepared once.
        """
        if not values:
            return self.parameters
        if values not in self._known:
            if len(self._known) >= KEPT_MACHINES:
                del self._known[next(iter(self._known))]
            of_laundry = [0.0] * (len(self.variables) - len(values))
            self._known[values] = self.varying.machine_at([*values, *of_laundry])
        return self._known[values]

    def check(self, is_usable: Callable[[Case], None]) -> None:
        """Check the machine at both ends of each quantity, the others at their medians.

        Args:
            is_usable: Raises an InputError if a case cannot be run.

        Raises:
            InputError: a quantity reaches a value that is not allowed.
        """
        problems = []
        medians = self.joint.values(np.zeros((1, len(self.variables))))[0]
        for index, variable in enumerate(self.variables):
            ends = self.joint.marginals[index].values(np.array([-np.inf, np.inf]))
            for end, value in zip(("lower", "upper"), ends, strict=True):
                values = medians.copy()
                values[index] = value
                try:
                    is_usable(self._case(f"{end} end of {variable.name}", values.tolist()))
                except InputError as error:
                    is_normal = "normal" in variable.entry.kind
                    hint = "; truncate it with low and high" if is_normal else ""
                    problems += [
                        Problem(
                            "",
                            variable.name,
                            f"its {end} end is not allowed: {p.key}: {p.message}{hint}",
                        )
                        for p in error.problems
                    ]
        if problems:
            raise InputError(problems)


def laundry_load(values: dict[str, float]) -> Load:
    """Return the load of a lump of laundry, or of two.

    Args:
        values: SI values by the names of `LAUNDRY`.
    """
    mass, angle, y, radius, share, lead, second_y = (values.get(name, 0.0) for name in LAUNDRY)
    if not 0.0 <= share <= 1.0:
        raise input_error(f"{share:.3g} is not a share from 0 to 1", key="laundry.second_share")
    first = {"mass": mass * (1.0 - share), "radius": radius, "y": y, "phase": angle}
    lumps = [first]
    if "laundry.second_share" in values:
        lumps.append(first | {"mass": mass * share, "y": second_y, "phase": angle + lead})
    try:
        return Load(unbalances=tuple(Unbalance.model_validate(lump) for lump in lumps))
    except ValidationError as error:
        raise InputError(problems_of(error, Unbalance, "laundry")) from None


def uncertain_machine(varying: Varying, file: VaryFile, case: Case) -> UncertainMachine:
    """Return a machine with the uncertain numbers of a file.

    Args:
        varying: The machine and its numbers that vary.
        file: Their file, with correlations.
        case: Case of the machine without changes.

    Raises:
        InputError: a number has no distribution, or the correlations name another one.
    """
    joint = joint_of(varying, file.correlations)
    return UncertainMachine(varying, joint, replace(case, parameters=varying.machine))


def joint_of(varying: Varying, correlations: Correlations | None) -> Joint:
    """Return the distribution of all numbers that vary.

    Raises:
        InputError: a number has no distribution, or the correlations name another one.
    """
    marginals = each(_marginal, varying.by_name)
    return Joint(tuple(marginals), _correlation_factor(correlations, varying.names))


def _marginal(varied: Varied) -> Marginal:
    """Return the distribution of a number. [1 for percent, else SI]"""
    n, kind, ends = varied.at, varied.entry.kind, ("low", "high")
    if not kind:
        has_ends = "low" in n and "high" in n
        line = "distribution: uniform" if has_ends else "prior: (VALUE, DEVIATION) UNIT"
        raise input_error(f"has no distribution, which samples need; add '{line}'", key=varied.name)
    if kind == "uniform":
        return uniform(n["low"], n["high"])
    if kind == "triangular":
        return triangular(n["low"], n["mode"], n["high"])
    given = {end: n[end] for end in ends if end in n}
    if kind == "normal":
        return normal(n["mean"], n["deviation"], **given)
    if varied.change is Change.DISTANCE or n["mean"] <= 0.0 or given.get("high", 1.0) <= 0.0:
        message = "a lognormal distribution needs a mean and an end above 0"
        raise input_error(message, key=varied.name)
    return lognormal(n["mean"], n["deviation"], **given)


def distribution_text(varied: Varied) -> str:
    """Return the distribution of a number in words."""
    kind = varied.entry.kind
    if "mean" not in varied.at:
        mode = f", mode {varied.reading('mode')}" if "mode" in varied.at else ""
        return f"{kind}, {varied.reading('low')} to {varied.reading('high')}{mode}"
    ends = [f"{end} {varied.reading(end)}" for end in ("low", "high") if end in varied.at]
    truncated = f", truncated ({', '.join(ends)})" if ends else ""
    return f"{kind}, {varied.reading('mean')} ± {varied.reading('deviation')}{truncated}"


def _correlation_factor(given: Correlations | None, names: Sequence[str]) -> FloatArray | None:
    """Return the Cholesky factor of the correlations of all numbers; None without any."""
    if given is None:
        return None
    for name in given.quantities:
        check_known(name, names, f"no quantity '{name}'", key="correlations.quantities")
    places = [names.index(name) for name in given.quantities]
    matrix = np.eye(len(names))
    matrix[np.ix_(places, places)] = np.array(given.matrix)
    return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
