"""Sentences of results say what their data say, on data for which a set sentence would be wrong."""

import numpy as np
import pytest
import xarray as xr
from made_up_runs import made_up

from wm_drake.parameters import load_machine, varying
from wm_drake.parameters.first_machine import FirstMachine, FirstNumbers
from wm_drake.parameters.vary_file import VaryFile, load_vary
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import Response
from wm_drake.studies.orders.page import order_text
from wm_drake.studies.tolerance.page import about_loads, masses_text, summary
from wm_drake.studies.tolerance.study import ToleranceSettings, ToleranceTrials
from wm_drake.studies.tolerance.variables import uncertain_machine

GAP = Response("gap", MEASURES["gap"].variables[0])
SPRING = "spring_types.suspension.stiffness"
PLACE = "loads.middle.unbalances.0.y"


@pytest.fixture(scope="module")
def machine():
    return load_machine("reference")


def tolerances(machine, tree, gap):
    """Return a tolerance study in which a function of the load gives the gap, and its samples."""

    def run(cases):
        table = {"smallest_gap": ("run", np.array([gap(case) for case in cases]))}
        return xr.Dataset(table)

    case = Case("middle", machine.loads["middle"], machine.profile)
    uncertain = uncertain_machine(varying(machine, tree.entries(without=())), tree, case)
    trials = ToleranceTrials(uncertain, (GAP,), made_up(run), ToleranceSettings(256, 256, 0))
    return trials, trials.samples()


def of_load(machine, *keys):
    """Return the sentences of a study in which numbers change the gap alike."""
    quantities = {
        key.rpartition(".")[-1]: {
            "keys": (key,),
            "distribution": "normal",
            "mean": "nominal",
            "deviation": size,
        }
        for key, size in keys
    }
    tree = VaryFile.model_validate({"loads": "middle", "vary": quantities})
    trials, samples = tolerances(machine, tree, lambda case: (
        0.03 + case.load.unbalances[0].y
        + 1e-5 * case.parameters.spring_types["suspension"].stiffness
    ))  # fmt: skip
    return " ".join(summary(trials, trials.indices(samples), xr.Dataset(), xr.Dataset()))


def test_nobody_can_tighten_a_load(machine):
    only = of_load(machine, (PLACE, "5 mm"))
    assert "To tighten: nothing; only the load scatters in this file." in only
    both = of_load(machine, (PLACE, "5 mm"), (SPRING, "0.5 N/mm"))
    assert "To tighten: stiffness" in both
    assert "y (" not in both.partition("To tighten")[2]


@pytest.mark.parametrize(
    ("mass", "words"),
    [
        ("0.5 kg", "middle (1 kg), counter (1 kg), back (0.7 kg) and front (0.7 kg) are heavier than all laundry of the samples, 0.2"),
        ("0.8 kg", "middle (1 kg) and counter (1 kg) are heavier than all laundry"),
        ("1.4 kg", "is as heavy as any of these loads."),
    ],
)  # fmt: skip
def test_loads_are_compared_with_the_laundry_that_was_drawn(machine, mass, words):
    tree = load_vary("laundry").model_dump()
    tree["vary"]["laundry.mass"]["high"] = mass
    gaps = xr.DataArray(np.full(4, 0.01), {"load": list(machine.loads)})
    text = about_loads(*tolerances(machine, VaryFile.model_validate(tree), lambda _: 0.02), gaps)
    assert words in text
    assert "often" not in text


def test_a_single_heavier_load_is_one(machine):
    text = masses_text(machine, ["middle", "front"], (0.2, 0.9))
    assert text == "middle (1 kg) is heavier than all laundry of the samples, 0.2 to 0.9 kg."


@pytest.mark.parametrize(
    ("order", "words"),
    [(0.9375, "order 1"), (1.0625, "order 1"), (2.0, "order 2"), (0.0625, "order 0"), (2.5, "order 2.50")],
)  # fmt: skip
def test_an_order_is_as_sharp_as_its_window(order, words):
    assert order_text(order) == words


@pytest.mark.parametrize(
    "name", ["gap", "drum_radius", "drum_depth", "tub_mass", "drum_mass", "speed"]
)
def test_a_given_number_of_a_new_machine_is_no_assumption(name):
    """Compare a number that is given with the same one left out."""
    value = getattr(FirstNumbers(), name)
    texts = []
    for numbers in (FirstNumbers(), FirstNumbers.model_validate({name: value})):
        new = FirstMachine("mine", numbers, {})
        texts.append(new.sdf() + new.yaml("mine.yaml", "mine.sdf"))
    left_out, given = texts
    assert given.count("given") == left_out.count("given") + 1
    assert left_out.count(": assumption") + left_out.count(" assumption") > given.count(
        ": assumption"
    ) + given.count(" assumption")
