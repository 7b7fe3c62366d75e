"""What the results of a gasket study are shown beside."""

from dataclasses import dataclass

from wm_drake.studies.gasket.check import Check
from wm_drake.studies.gasket.level_zero import LevelZero
from wm_drake.studies.gasket.published import NOTHING, Published


@dataclass(frozen=True)
class Beside:
    """Results that are shown beside those of a screening.

    Attributes:
        published: Published results; empty if nothing is compared.
        level_zero: Responses of the machine and of level 0 with each treatment of tables; None if
            no factor has a table.
        check: Runs of chosen settings beside the fitted model; None if there are none.
    """

    published: Published = NOTHING
    level_zero: LevelZero | None = None
    check: Check | None = None


ALONE = Beside()
"""A screening that is compared with nothing."""
