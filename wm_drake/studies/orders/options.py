"""Options of the command `wm-drake record orders`, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import OptionModel, Study, imported, option


class OrdersOptions(OptionModel):
    """Options of the orders of a record."""

    file: Path = option(
        ...,
        "netCDF record of the command spin; or CSV, MDF4, TDMS, UFF 58 or MAT with time_s, "
        "speed_rpm and a column for each signal, such as accelerations.",
        "FILE",
        "argument",
    )
    highest: float = option(6.0, "Highest order of the map.", ge=1.0, le=40.0)
    unit: str = option("m/s^2", "Unit of the signals of a CSV, for tables and axes.")
    channels: str | None = option(
        None, "Names in the files: 'S1_x=Acc 1,S1_y=Acc 2' (also time and speed).", "WORD=NAME,..."
    )


ORDERS = Study(
    "orders",
    "Compute waterfall and order map of the signals of a record.",
    OrdersOptions,
    imported("wm_drake.studies.orders.task:OrdersTask"),
    has_runs=False,
    group="record",
    has_machine=False,
)
