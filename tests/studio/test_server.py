"""The server of the studio: answers, problems at values, saved files, and who is let in."""

import json
from dataclasses import replace

import numpy as np
import pytest
from starlette.testclient import TestClient

from wm_drake.live.state import DESCRIBED
from wm_drake.parameters import load_machine, with_values
from wm_drake.parameters.variation import number_at
from wm_drake.simulation.cases import case_of
from wm_drake.simulation.displacements import envelopes
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import simulate
from wm_drake.studio import server
from wm_drake.studio.guard import LARGEST_BODY
from wm_drake.studio.server import Studio, application

TOKEN, PORT = "token-of-the-test", 8765
OWN = f"http://127.0.0.1:{PORT}"
HOSTILE = "<script>alert(1)</script>"
STIFFNESS = "gasket.stiffness_x"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("studio")


@pytest.fixture(scope="module")
def client(folder):
    with TestClient(
        application(Studio("reference", folder), TOKEN, PORT),
        base_url=f"{OWN}/{TOKEN}/",
        raise_server_exceptions=True,
    ) as client:
        yield client


def state(values=None, **others):
    return {"machine": "reference", "values": values or {}, "load": "middle", **others}


def run(client, values=None, **others):
    return client.post("api/run", json={"page": "test", "state": state(values, **others)})


def answered(client, values=None, keys=(), **others):
    """Return both parts of an answer."""
    body = {"page": "test", "state": state(values, **others)}
    parts = (
        client.post("api/run", json=body),
        client.post("api/numbers", json=body | {"keys": list(keys)}),
    )
    assert [part.status_code for part in parts] == [200, 200]
    return {**parts[0].json(), **parts[1].json()}


@pytest.fixture(scope="module")
def answer(client):
    return answered(client, {STIFFNESS: "4 N/mm"}, ["bodies.drum.mass", STIFFNESS])


@pytest.fixture(scope="module")
def moved(reference):
    return with_values(reference, {STIFFNESS: number_at(reference, STIFFNESS).at(4000.0)})


def values_of(answer):
    """Return the numbers of the table of measures by title."""
    return {row["title"]: row["value"] for row in answer["rows"]}


def test_answer_is_that_of_a_single_run(answer, machine, moved):
    case = replace(case_of(moved, "middle"), parameters=moved)
    record = simulate(machine, case)
    measures = measure(record)
    shown = values_of(answer)
    for label, value in zip("xyz", measures.gasket_force.values, strict=True):
        assert shown[f"gasket F{label}, N"] == value
    for mount, value in zip(record.mount.values, measures.mount_force_peak.values, strict=True):
        words = str(mount).replace("s.", " ").replace("_", " ")
        assert shown[f"{words}, N"] == value
    for sensor, value in zip(record.sensor.values, measures.amplitude.values, strict=True):
        assert shown[f"{sensor}, mm"] == pytest.approx(1e3 * value, rel=1e-15)
    band = envelopes(record)
    for sensor, sides in enumerate(answer["envelopes"]):
        for side in ("upper", "lower"):
            time, value = (np.asarray(numbers) for numbers in sides[side])
            drawn = np.interp(record.time.values, time / 1e3, value / 1e6)
            assert np.abs(drawn - band[side].values[:, sensor]).max() < 1.001e-6
    bands = answer["forces"]["bands"]
    for axis, name in enumerate("xyz"):
        history = record.bushing_force.sel(bushing="gasket").values[:, axis]
        low, high = bands[f"gasket F{name}"]
        assert (min(low), max(high)) == pytest.approx((history.min(), history.max()), abs=1e-3)


def test_gap_with_each_load_is_that_of_its_run(client, answer):
    found = {of["load"]: of for of in answer["loads"]}
    assert found["middle"]["gap"] == answer["gap"]
    other = run(client, {STIFFNESS: "4 N/mm"}, load="back").json()
    assert found["back"]["gap"]["distance"] == pytest.approx(other["gap"]["distance"], abs=2e-3)
    assert list(found) == ["middle", "counter", "back", "front"]
    assert [of["load"] for of in other["loads"]] == ["back", "middle", "counter", "front"]


def test_arrow_is_the_difference_of_two_runs(client, answer):
    arrow = next(of for of in answer["arrows"] if of["key"] == STIFFNESS)
    other = answered(client, {STIFFNESS: f"{4.0 + arrow['step']!r} N/mm"})
    before, after = values_of(answer), values_of(other)
    for title, change in zip(before, arrow["changes"], strict=True):
        expected = after[title] - before[title]
        near = {"abs": 2e-3} if "gap" in title else {"rel": 1e-6, "abs": 1e-9}
        assert change == pytest.approx(expected, **near), title


def test_every_number_can_be_turned_or_is_left_out(client):
    keys = [STIFFNESS, "bodies.drum.mass", "loads.middle.unbalances.0.mass", "gravity"]
    found = client.post("api/ranking", json={"page": "test", "state": state(), "keys": keys})
    assert found.status_code == 200
    assert [arrow["key"] for arrow in found.json()["arrows"]] == keys[:3]


def test_numbers_that_are_not_there_cost_no_run(client, monkeypatch):
    monkeypatch.setattr(server, "arrows", None)
    keys = [f"springs.{n}.stiffness" for n in range(100)]
    found = client.post("api/ranking", json={"page": "test", "state": state(), "keys": keys})
    assert found.json() == {"arrows": []}


def test_long_names_are_shortened_in_every_message(client):
    name = "x" * 3000
    for answer in (
        client.get(f"api/machine?id={name}"),
        client.post(f"api/studies/{name}/cancel", json={}),
        client.post(f"api/studies/{name}/resume", json={}),
        client.get(f"reports/{name}/report.html"),
    ):
        assert answer.status_code == 422
        assert len(answer.text) < 700


def test_number_that_was_zero_builds_its_element(client, answer):
    found = answered(client, {STIFFNESS: "4 N/mm", "gasket.cross_stiffness_x_z": "0.5 N/mm"})
    assert values_of(found)["Xr, mm"] != pytest.approx(values_of(answer)["Xr, mm"], rel=1e-6)


def test_smallest_gap_is_drawn_where_it_is(answer):
    first, second = np.array(answer["gap_points"]["points"])
    assert 1e3 * np.linalg.norm(first - second) == pytest.approx(
        answer["gap"]["distance"], abs=2e-3
    )


def test_measured_amplitudes_stand_beside(client, answer):
    experiment = next(of for of in answer["measured"] if of["source"] == "experiment")
    assert experiment["amplitude"]["Xr"] == 14.55
    without = answered(client, gasket=False)
    assert without["measured"][0]["amplitude"]["Xr"] == 11.8
    assert not any(name.startswith("gasket") for name in without["forces"]["bands"])


def test_described_load_runs(client, answer):
    mass = {"mass": "500 g", "radius": "235 mm", "y": "0 mm", "phase": "0 deg"}
    found = answered(client, masses=[mass])
    assert values_of(found)["Xr, mm"] < 0.8 * values_of(answer)["Xr, mm"]
    assert [of["load"] for of in found["loads"]] == [
        DESCRIBED,
        "middle",
        "counter",
        "back",
        "front",
    ]
    assert found["measured"] == []
    wrong = run(client, masses=[mass | {"mass": "3"}])
    assert wrong.json()["problems"][0]["key"] == "masses.0.mass"


@pytest.mark.parametrize(
    ("key", "text", "words"),
    [
        (STIFFNESS, "3", "'3' has no unit; write for example '1 N/mm'"),
        (STIFFNESS, "-3 N/mm", "out of range; allowed is >= 0"),
        (STIFFNESS, HOSTILE, "is not a number with a unit"),
        ("frames.spring_left_tub.position.2", "3 kg", "unit 'kg' does not fit"),
        ("profile.time.1", "90 s", "times must rise"),
        ("profile.time.2", "9000 s", "too long for this page"),
        ("step", "0.0000005 s", "does not divide|too long"),
        ("gasket.stiffness_q", "3 N/mm", "is not a number of the machine"),
        ("model", "/etc/passwd", "is not a number of the machine"),
        ("measured.0", "/etc/passwd", "is not a number of the machine"),
    ],
)
def test_problem_is_told_at_its_value(client, key, text, words):
    found = run(client, {key: text, "bodies.tub.mass": "7 kg"})
    (problem,) = found.json()["problems"]
    assert found.status_code == 422
    assert key.startswith(problem["key"])
    assert any(part in problem["message"] for part in words.split("|"))


def test_all_wrong_values_are_told_at_once(client):
    found = run(client, {STIFFNESS: "3", "bodies.tub.mass": "-1 kg"}).json()
    assert {problem["key"] for problem in found["problems"]} == {STIFFNESS, "bodies.tub.mass"}


def test_unusual_value_is_warned_of(client):
    key = "damper_types.friction.friction_force"
    (warning,) = run(client, {key: "400 N"}).json()["warnings"]
    assert warning["key"] == key
    assert "400 N is unusual; usual is 0 to 300 N" in warning["message"]


def test_machine_lists_every_number(client):
    page = client.get("api/machine", params={"id": "reference"}).json()
    by_key = {number["key"]: number for number in page["numbers"]}
    own = load_machine("reference").gasket.stiffness_x.nominal_stiffness
    assert by_key[STIFFNESS]["value"] == pytest.approx(1e-3 * own)
    assert by_key[STIFFNESS]["allowed"] == "≥ 0"
    assert by_key["bodies.drum.mass"]["unit"] == "kg"
    assert by_key["cabinet.mass"]["allowed"] == "> 0"
    assert all(n["low"] <= n["value"] <= n["high"] for n in page["numbers"])
    assert all((n["low"] == n["high"]) == bool(n["needs"]) for n in page["numbers"])


def test_saved_machine_has_only_what_differs(client, folder, reference):
    values = {STIFFNESS: "4 N/mm", "frames.gasket_tub.position.0": "3 mm"}
    body = {"state": state(values), "name": "mine"}
    assert client.post("api/save", json=body).json() == {"saved": "mine.yaml"}
    text = (folder / "mine.yaml").read_text()
    assert "extends: reference" in text
    assert "spring_types" not in text
    saved = load_machine(folder / "mine.yaml")
    assert saved.gasket.stiffness_x.nominal_stiffness == pytest.approx(4000.0)
    assert saved.frames["gasket_tub"].position[0] == 0.003
    assert saved.springs == reference.springs
    assert saved.sources[f"{STIFFNESS}.force"].startswith("set in wm-drake studio")
    again = client.post("api/save", json=body)
    assert (again.status_code, again.json()["exists"]) == (409, True)
    assert client.post("api/save", json=body | {"overwrite": True}).status_code == 200
    listed = client.get("api/machines").json()["machines"]
    assert {"id": "mine.yaml", "kind": "saved"} in listed
    own = body | {"state": state() | {"machine": "mine.yaml"}, "overwrite": True}
    assert "extends" in client.post("api/save", json=own).json()["problems"][0]["message"]


def test_machine_without_gasket_and_with_described_load_is_saved(client, folder):
    mass = {"mass": "500 g", "radius": "235 mm", "y": "0 mm", "phase": "90 deg"}
    chosen = state(gasket=False, masses=[mass])
    assert client.post("api/save", json={"state": chosen, "name": "bare"}).status_code == 200
    saved = load_machine(folder / "bare.yaml")
    assert saved.gasket is None
    assert saved.loads["described"].unbalances[0].mass == 0.5


@pytest.mark.parametrize(
    "name", ["../outside", "/tmp/outside", "a/b", "", ".hidden", "x" * 65, HOSTILE]
)
def test_hostile_name_is_not_saved(client, folder, name):
    before = sorted(folder.parent.rglob("*"))
    found = client.post("api/save", json={"state": state(), "name": name})
    assert found.status_code == 422
    assert sorted(folder.parent.rglob("*")) == before


def test_machine_outside_of_the_folder_is_not_opened(client, folder):
    (folder.parent / "secret.yaml").write_text("extends: reference\nname: secret\n")
    for name in ("../secret.yaml", str(folder.parent / "secret.yaml"), "nowhere", ""):
        assert client.get("api/machine", params={"id": name}).status_code == 422


def test_hostile_name_of_a_machine_is_plain_text(client, folder):
    text = f"extends: reference\nname: {json.dumps(HOSTILE)}\nabout: {json.dumps(HOSTILE)}\n"
    (folder / "hostile.yaml").write_text(text)
    found = client.get("api/machine", params={"id": "hostile.yaml"})
    assert found.json()["name"] == HOSTILE
    assert found.headers["content-type"] == "application/json"
    assert found.headers["x-content-type-options"] == "nosniff"
    policy = client.get("./").headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "unsafe" not in policy


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"host": "evil.example"}, 403),
        ({"host": f"evil.example:{PORT}"}, 403),
        ({"host": "127.0.0.1:1"}, 403),
        ({"origin": "https://evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": f"http://127.0.0.1:{PORT + 1}"}, 403),
        ({"origin": OWN}, 200),
        ({"host": f"localhost:{PORT}"}, 200),
        ({}, 200),
    ],
)
def test_only_the_page_itself_is_let_in(client, headers, status):
    found = client.get(f"{OWN}/{TOKEN}/api/machines", headers=headers)
    assert found.status_code == status


@pytest.mark.parametrize(
    "path", ["/", "/wrong/", "/api/machines", f"/{TOKEN[:-1]}/api/machines", "/static/main.js"]
)
def test_without_token_there_is_nothing(client, path):
    found = client.get(OWN + path)
    assert (found.status_code, found.text) == (404, "not found")


def test_form_of_another_page_is_refused(client):
    body = json.dumps({"state": state(), "name": "forged"})
    found = client.post("api/save", content=body, headers={"content-type": "text/plain"})
    assert found.status_code == 415
    assert client.put("api/save", content=body).status_code == 405


def test_large_body_is_refused_before_it_is_read(client):
    read = 0

    def pieces():
        nonlocal read
        for _ in range(100):
            read += 1 << 20
            yield b"x" * (1 << 20)

    json_type = {"content-type": "application/json"}
    declared = json_type | {"content-length": str(100 << 20)}
    assert client.post("api/run", content=b"{}", headers=declared).status_code == 413
    assert (
        client.post("api/run", content=b"x" * (LARGEST_BODY + 1), headers=json_type).status_code
        == 413
    )
    assert client.post("api/run", content=pieces(), headers=json_type).status_code == 413


@pytest.mark.parametrize("body", [b"", b"[]", b"{", b'{"page": 1}', b"[" * 10_000])
def test_malformed_body_is_refused(client, body):
    found = client.post("api/run", content=body, headers={"content-type": "application/json"})
    assert found.status_code == 400


def test_files_of_the_package_cannot_be_left(client):
    for path in ("static/../server.py", "static/%2e%2e/server.py", "reports/gasket-1/..%2f..%2fx"):
        assert client.get(f"{OWN}/{TOKEN}/{path}").status_code in (404, 422)
