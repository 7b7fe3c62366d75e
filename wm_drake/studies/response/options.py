"""Options of the study of the steady response, and its declaration."""

from wm_drake.studies.study import LOADS, Options, Study, imported, option


class ResponseOptions(Options):
    """Options of the study of the steady response."""

    load: tuple[str, ...] = LOADS
    no_gasket: bool = option(False, "Only without gasket. Default: with and without.")
    low: str = option("40 rpm", "Lowest drum speed.", "SPEED", "--from")
    high: str | None = option(
        None, "Highest drum speed. Default: the fastest of the spin profile.", "SPEED", "--to"
    )
    points: int = option(121, "Number of speeds, at equal distances.", ge=2, le=5000)
    harmonics: int = option(11, "Number of harmonics of the drum's rotation.", ge=1, le=40)
    rate: tuple[str, ...] = option(
        (), "Sweep rate. Repeatable. Default: 1, 2, 5, 10, 20 and 50 rpm/s.", "RATE"
    )
    no_sweeps: bool = option(False, "Leave the sweeps out.")
    workers: int | None = option(None, "Number of cores. Default: all.", "N", ge=1)


RESPONSE = Study(
    "response",
    "Compute the steady response to unbalance over the drum speed, by harmonic balance.",
    ResponseOptions,
    imported("wm_drake.studies.response.task:ResponseTask"),
    quick={"load": ("middle",), "points": 15, "harmonics": 3, "rate": ("50 rpm/s",)},
    has_runs=False,
)
