"""The page of `wm-drake machine check --page`: all parts are drawn where they are at rest."""

import json
import re
from pathlib import Path

import numpy as np
import pytest


@pytest.mark.parametrize("name", ["reference", "free_stroke", "rodrigues_2010"])
def test_page_draws_every_part(wm_drake, name):
    ended = wm_drake("machine", "check", name, "--page", "machine.html")
    assert ended.code == 0
    page = Path("machine.html").read_text(encoding="utf-8")
    things = json.loads(re.search(r'id="things">(.*?)</script>', page, re.DOTALL)[1])
    shown = json.loads(wm_drake("machine", "show", name, "--json").out)
    drawn = {(thing["kind"], thing["name"]) for thing in things}
    assert drawn >= {("spring", spring) for spring in shown["springs"]}
    assert drawn >= {("sensor", sensor) for sensor in shown["sensors"]}
    assert drawn >= {("gasket", bushing) for bushing in shown["bushings"]}
    for thing in things:
        if thing["kind"] == "spring":
            (ends,) = thing["lines"]
            length = float(np.linalg.norm(np.subtract(*ends)))
            assert length == pytest.approx(shown["springs"][thing["name"]]["length_at_rest"])
