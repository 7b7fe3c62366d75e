"""The task of the study of orders: the file read and its maps computed."""

from wm_drake.studies.answer import Answer
from wm_drake.studies.executor import Executor
from wm_drake.studies.inputs import channel_names, existing_file
from wm_drake.studies.orders.options import OrdersOptions
from wm_drake.studies.orders.page import orders_answer
from wm_drake.studies.orders.study import orders_of, read_signals
from wm_drake.studies.study import Task


class OrdersTask(Task):
    """Orders of the signals of a file."""

    def __init__(self, options: OrdersOptions) -> None:
        """Read the file."""
        file = existing_file(options.file, "FILE")
        names, unit = channel_names(options)
        self.signals, self.source = read_signals(file, names, unit), file.name
        self.highest = options.highest

    def run(self, executor: Executor) -> Answer:  # noqa: ARG002
        """Compute the maps."""
        maps = orders_of(self.signals, self.highest, self.source)
        return orders_answer(maps, self.source, self.signals.attrs.get("findings", ()))
