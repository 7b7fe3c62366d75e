"""How a result was computed, for the end of its page."""

from dataclasses import dataclass

from wm_drake.engines import DEFAULT_ENGINE

PAGE = "report.html"
"""Name of the file of the main page."""


@dataclass(frozen=True)
class Facts:
    """How a result was computed.

    Attributes:
        command: Command line or Python call.
        wall_s: Duration. [s]
        warnings: Warnings of the machine, without those of the result.
        step: Largest step, as the machine has it; runs may take shorter ones. 0 without a machine,
            or with several. [s]
        integrator: Integrator of the compiled engine, as the machine has it.
        engine: Name of the engine; "" without runs.
        steps: Steps that the runs took and the error that remains; "" without runs.
        runs: Number of runs.
    """

    command: str = ""
    wall_s: float = 0.0
    warnings: tuple[str, ...] = ()
    step: float = 0.0
    integrator: str = ""
    steps: str = ""
    runs: int = 0
    engine: str = ""

    def rows(self) -> list[tuple[str, str]]:
        """Return the facts as pairs of word and text, for the end of a page."""
        from wm_drake.batch import sources_version
        from wm_drake.report.quantity import STEP
        from wm_drake.simulation.records import versions

        step = f"{STEP.text(self.step)}, integrator {self.integrator}"
        step = step if self.engine in ("", DEFAULT_ENGINE) else STEP.text(self.step)
        return [
            *([("Engine", self.engine)] if self.engine else []),
            *([("Largest step", step)] if self.step else []),
            *([("Steps taken", self.steps)] if self.steps else []),
            ("Versions", ", ".join(f"{name} {text}" for name, text in versions().items())),
            ("Sources", sources_version()),
            ("Command", self.command),
        ]
