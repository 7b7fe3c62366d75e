"""What pages say of stops, from made-up measures."""

import numpy as np
import xarray as xr

from wm_drake.studies.stops import stops_sentence


def measures(hits, velocity, force):
    return xr.Dataset(
        {
            "stop_hits": (("load", "stop"), hits),
            "stop_hit_velocity": (("load", "stop"), velocity),
            "mount_force_peak": (("load", "mount"), force),
        },
        {
            "load": ["front", "back"],
            "stop": ["left", "right"],
            "mount": ["springs.left", "elements.left", "elements.right"],
        },
    )


def test_each_stop_is_named_with_the_load_of_its_largest_force():
    hits = np.array([[3.0, 0.0], [1.0, 0.0]])
    velocity = np.array([[0.2, 0.0], [1.2, 0.0]])
    force = np.array([[900.0, 40.0, 0.0], [900.0, 310.0, 0.0]])
    text = stops_sentence(measures(hits, velocity, force))
    assert "left with 310.0 N at 1.20 m/s (load back, 1 hit)" in text
    assert "right" not in text


def test_a_force_without_a_hit_is_no_hit():
    hits, force = np.zeros((2, 2)), np.full((2, 3), 50.0)
    assert "does not meet" in stops_sentence(measures(hits, hits, force))


def test_a_machine_without_stops_has_no_sentence():
    whole = measures(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 3)))
    assert stops_sentence(whole.isel(stop=slice(0))) == ""
    assert stops_sentence(xr.Dataset()) == ""
