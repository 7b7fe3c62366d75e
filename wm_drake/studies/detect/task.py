"""Check the options of the study of detection, and run it."""

import math
from typing import Any

from wm_drake.errors import check_known, input_error, problems_at
from wm_drake.model.machine import Machine
from wm_drake.parameters.limits import fraction
from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.responses import GAP, has_gap
from wm_drake.studies.answer import Answer
from wm_drake.studies.detect.decision import NoThresholdError
from wm_drake.studies.detect.estimators import ESTIMATORS
from wm_drake.studies.detect.holds import hold_of
from wm_drake.studies.detect.options import DetectOptions
from wm_drake.studies.detect.page import RiskQuestion, detect_answer
from wm_drake.studies.detect.signals import FEATURES, chosen_signals, known_signals
from wm_drake.studies.detect.study import Plan, draws_of
from wm_drake.studies.executor import Executor
from wm_drake.studies.experiment import Experiment
from wm_drake.studies.study import Task
from wm_drake.studies.tolerance.options import ToleranceOptions
from wm_drake.studies.tolerance.task import ToleranceTask

FEWEST = 1024
"""Smallest number of draws if the user gives none."""


class DetectTask(Task):
    """The study with checked options."""

    def __init__(self, options: DetectOptions, machine: Machine) -> None:
        """Check signals, holds, the laundry and the risk."""
        self.options, parameters = options, machine.parameters
        if not has_gap(parameters):
            message = "the SDF has no shapes on both tub and housing, so nothing can touch"
            raise input_error(message)
        signals = chosen_signals(parameters, options.signal)
        self.clearance = _number(options.clearance, Unit("m", "mm"), "--clearance")
        self.retry = _number(options.retry, Unit("s", "s"), "--retry")
        duration = _number(options.hold, Unit("s", "s"), "--hold")
        self.risk = _risk(options.risk)
        samples = options.samples or max(FEWEST, 2 ** math.ceil(math.log2(4.0 / self.risk)))
        of_laundry = ToleranceOptions(
            file=options.laundry, samples=samples, sensitivity=0, subset=0, response=(GAP,),
            profile=options.profile, seed=options.seed,
        )  # fmt: skip
        self.laundry = ToleranceTask(of_laundry, machine)
        spin = self.laundry.uncertain.case.profile
        self.holds = tuple(
            hold_of(text, spin, duration, options.turns) for text in options.at or (None,)
        )
        families = tuple(part.strip() for part in options.features.split(","))
        for name in families:
            check_known(name, FEATURES, f"no features '{name}'", where="--features")
        estimator = ESTIMATORS.find(options.estimator, where="--estimator")
        self.plan = Plan(0, signals, families, options.turns, estimator)
        named = {signal.name for signal in signals}
        self.more = tuple(
            signal
            for name, signal in known_signals(parameters).items()
            if name not in named and signal.kind != "acceleration"
        )

    @property
    def identity(self) -> dict[str, Any]:
        """Return what determines the spins beside the machine."""
        return self.laundry.identity  # without holds: another speed reuses the spins

    def run(self, executor: Executor) -> Answer:
        """Run holds and spins, and judge thresholds and estimates."""
        trials = self.laundry.trials(executor)
        cases = list(self.laundry.uncertain.cases(trials.scores[0]))
        experiment = Experiment(self.laundry.machine, (), executor.simulate)
        draws = draws_of(
            experiment, cases, self.holds, self.clearance, self.options.seed,
            has_accelerometers=any(s.kind == "acceleration" for s in self.plan.signals),
        )  # fmt: skip
        question = RiskQuestion(
            self.laundry.uncertain.parameters, self.plan, self.risk, self.retry,
            self.laundry.file.about, self.options.risk,
        )  # fmt: skip
        try:
            return detect_answer(question, draws, self.more)
        except NoThresholdError as error:
            raise input_error(
                f"no threshold reaches {self.options.risk} with {len(cases)} draws: {error}; allow "
                "more risk, draw more with --samples, or try another signal or speed",
                where="--risk",
            ) from None


def _number(text: str, unit: Unit, option: str) -> float:
    """Return a number of an option that is 0 or above. [SI]"""
    with problems_at(option, ""):
        try:
            value = unit.number(text)
        except ValueError as error:
            raise input_error(str(error)) from None
        if not 0.0 <= value < math.inf:
            raise input_error(f"'{text}' is not 0 or above")
        return value


def _risk(text: str) -> float:
    """Return the tolerated risk."""
    try:
        risk = fraction(text, "risk")
    except ValueError as error:
        raise input_error(str(error), where="--risk") from None
    if not 1e-5 <= risk < 1.0:
        raise input_error(
            f"'{text}' is not allowed; allowed are 0.001 % to below 100 %", where="--risk"
        )
    return risk
