"""Options of the command `wm-drake record orders`, and its declaration."""

from pathlib import Path

from wm_drake.studies.study import OptionModel, Study, imported, option


class OrdersOptions(OptionModel):
    """Options of the orders of a record."""

    file: Path = option(
        ...,
        "Record of the command spin (netCDF); or CSV, MDF, TDMS, UFF 58, MAT or HDF5 with a time, "
        "a channel speed and one for each signal, such as accelerations.",
        "FILE",
        "argument",
    )
    highest: float = option(6.0, "Highest order of the map.", ge=1.0, le=40.0)
    unit: tuple[str, ...] = option(
        (),
        "Unit of a channel whose file has none: 'Acc 1=g'; of all signals: 'g'. Default: m/s^2; "
        "rpm for the speed, s for the time. Repeatable.",
        "NAME=UNIT",
    )
    channels: str | None = option(
        None,
        "Names in the files: 'S1_x=Acc 1,S1_y=Group/Acc 2' (also time and speed).",
        "WORD=NAME,...",
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
