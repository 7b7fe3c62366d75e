"""Check the options of `identify --static`, and find the curves."""

from collections.abc import Sequence
from pathlib import Path

from wm_drake.errors import input_error
from wm_drake.parameters import Component, MeasuredLoop
from wm_drake.studies.answer import Answer
from wm_drake.studies.components import axes_of, target_of
from wm_drake.studies.executor import Executor
from wm_drake.studies.identify.fragment import Destination
from wm_drake.studies.identify.inputs import loops_of
from wm_drake.studies.identify.options import IdentifyAxisOptions, IdentifyDamperOptions
from wm_drake.studies.identify.static import SPONGE, is_about, static_curve
from wm_drake.studies.identify.static_page import static_answer
from wm_drake.studies.inputs import pairs_of
from wm_drake.studies.study import Task


class IdentifyStaticTask(Task):
    """Quasi-static tests with checked options."""

    def __init__(self, kind: str, options: IdentifyAxisOptions | IdentifyDamperOptions) -> None:
        """Find the component and read the tests of each axis, or of the sponge of a damper."""
        self.options, self.target = options, target_of(kind, options)
        component = self.target.component
        self.title = kind if component.name == kind else f"{kind} {component.name}"
        if isinstance(options, IdentifyAxisOptions):
            by_axis = _files_by_axis(options.files, options.axis)
        else:
            _check_sponge(component)
            by_axis = {(SPONGE,): list(options.files)}
        self.tests = {axes: _loops(paths, options, axes[0]) for axes, paths in by_axis.items()}

    def run(self, executor: Executor) -> Answer:
        """Compute the curve of each axis."""
        curves = {axes: static_curve(axes[0], loops) for axes, loops in self.tests.items()}
        changes = dict(pairs_of(self.options.sets, "--set"))
        destination = Destination(self.target, executor.out or Path(), changes)
        return static_answer(self.title, self.tests, curves, self.options.knots, destination)


def _check_sponge(damper: Component) -> None:
    if not hasattr(damper.parameters, SPONGE):
        law = damper.parameters.law  # type: ignore[union-attr]
        raise input_error(
            f"damper {damper.name} has the law {law}, which has no table; a quasi-static test "
            "gives the table of the sponge of the law free_stroke",
            where="--static",
        )


def _files_by_axis(files: Sequence[Path], axis: str | None) -> dict[tuple[str, ...], list[Path]]:
    """Return the files of each axis, of AXIS=FILE or all of one axis."""
    by_axis: dict[tuple[str, ...], list[Path]] = {}
    for path in files:
        word, separator, name = str(path).partition("=")
        if axis is not None:
            word, name = axis, str(path)
        elif not separator:
            raise input_error(
                f"'{path}' names no axis; write for example radial={path}, or --axis", where="FILES"
            )
        by_axis.setdefault(axes_of(word), []).append(Path(name))
    used = [one for axes in by_axis for one in axes]
    for one in used:
        if used.count(one) > 1:
            raise input_error(f"axis {one} is tested under two names", where="FILES")
    return by_axis


def _loops(
    paths: Sequence[Path], options: IdentifyAxisOptions | IdentifyDamperOptions, axis: str
) -> list[MeasuredLoop]:
    loops = loops_of(paths, options)
    if loops[0].rotates != is_about(axis):
        needs = "angles and moments" if is_about(axis) else "displacements and forces"
        raise input_error(f"axis {axis} needs {needs}", where=loops[0].path)
    return loops
