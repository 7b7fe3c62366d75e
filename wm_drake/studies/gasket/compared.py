"""What the results of a gasket study are compared with."""

from dataclasses import dataclass

from wm_drake.studies.gasket.check import Check
from wm_drake.studies.gasket.level_zero import LevelZero
from wm_drake.studies.gasket.proposal import Proposal
from wm_drake.studies.gasket.published import NOT_PUBLISHED, Published


@dataclass(frozen=True)
class Compared:
    """Results that are shown next to those of a screening.

    Attributes:
        published: Published results; empty if nothing is compared.
        level_zero: Responses of the machine and of level 0 with each treatment of tables; None if
            no factor has a table.
        check: Runs of chosen settings next to the fitted model; None if there are none.
        proposal: Setting that is proposed, with its runs; None if none was sought.
    """

    published: Published = NOT_PUBLISHED
    level_zero: LevelZero | None = None
    check: Check | None = None
    proposal: Proposal | None = None


NOT_COMPARED = Compared()
"""A screening that is compared with nothing."""
