"""Input of studies of a spin cycle: unbalance cases and measurements."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import xarray as xr

from wm_drake.errors import InputError, input_error, nearest_names
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.unbalance_cases import TABLE_9, UnbalanceCase, load_unbalance_cases
from wm_drake.studies.inputs import existing_file
from wm_drake.studies.spin_cycle.measured import read_accelerations, read_rms
from wm_drake.studies.spin_cycle.study import labels_of, runs_of


def cases_of_table(path: Path | None, names: Sequence[str] | None) -> list[UnbalanceCase]:
    """Return the cases that `--cases` and `--case` select."""
    table = load_unbalance_cases(existing_file(path, "--cases") if path else TABLE_9)
    known = {case.name: case for case in table}
    for name in names or []:
        if name not in known:
            raise input_error(f"unknown case '{name}'{nearest_names(name, known)}", where="--case")
    return [known[name] for name in dict.fromkeys(names)] if names else table


@dataclass(frozen=True)
class MeasuredFiles:
    """Files of measurements of a spin cycle; at most one of the two.

    Attributes:
        rms: Table of RMS displacements.
        accelerations: Folder of records of acceleration.
        channels: Names of the channels in the records, by word.
    """

    rms: Path | None = None
    accelerations: Path | None = None
    channels: Mapping[str, str] = field(default_factory=dict)

    def read(
        self, parameters: MachineParameters, cases: list[UnbalanceCase], profile: SpinProfile
    ) -> xr.DataArray | None:
        """Return the measured RMS displacements, or None without files.

        Raises:
            InputError: both kinds of files are given, a file is wrong, or a case cannot be run.
        """
        if self.rms and self.accelerations:
            raise input_error("not allowed together with --measured", where="--accelerations")
        if self.channels and not self.accelerations:
            raise input_error("is about the files of --accelerations", where="--channels")
        try:
            runs_of(parameters, cases, profile)  # raises an error for cases that cannot be run
        except InputError as error:
            raise InputError(
                replace(p, where="--profile", key="") if p.key == "profile" else p
                for p in error.problems
            ) from None
        labels = labels_of(parameters, cases, profile)
        if self.rms:
            return read_rms(existing_file(self.rms, "--measured"), labels)
        if self.accelerations:
            return read_accelerations(self.accelerations, labels, profile, self.channels)
        return None
