"""Show what the checks of their health found in records, on the page of any command."""

from collections.abc import Mapping, Sequence

import xarray as xr

from wm_drake.parameters.recorded.health import CHECKS, Finding
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity
from wm_drake.studies.answer import Part

SAMPLES = Quantity("samples left out", decimals=0)


def health_part(findings: Mapping[str, Sequence[Finding]]) -> Part:
    """Return the section about the health of records.

    Args:
        findings: What was found in each record, by its name.
    """
    rows = [(name, finding) for name, of_record in findings.items() for finding in of_record]
    checks = ", ".join(check.name for check in CHECKS)
    text = (
        f"Each channel was examined before it was compared with anything: {checks}; rounded time "
        "stamps, jumps of the clock, and pulses that are missing or too many. "
    )
    if not rows:
        return Part("Health of the records", text=f"{text}Nothing was found.")
    data = xr.Dataset(
        {
            "record": ("found", [name for name, _ in rows]),
            "channel": ("found", [finding.channel for _, finding in rows]),
            "check": ("found", [finding.check for _, finding in rows]),
            "where": ("found", [finding.where for _, finding in rows]),
            "samples": SAMPLES.variable("found", [finding.samples for _, finding in rows]),
            "text": ("found", [finding.text for _, finding in rows]),
        }
    )
    table = LabelledTable("health", data, "What was found", "What is left out is in no result.")
    return Part("Health of the records", (table,), text)
