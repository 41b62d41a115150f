from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, classes
from auv_fault_env.unmodelled import UNMODELLED
from training.benchmark import freeze_suites, suites
from training.seeds import purpose_of

SUITES = {name: suites.load(name) for name in suites.NAMES}


def small(n=2, **changes):
    suite = SUITES["thesis"]
    return replace(suite, **{"episodes": suite.episodes[:n]} | changes)


def written(path, suite):
    path.write_bytes(suite.text().encode())
    return str(path)


@pytest.mark.parametrize("name", suites.NAMES)
def test_a_suite_is_written_as_it_was_read(name):
    assert SUITES[name].text() == suites.read(suites.FOLDER / f"{name}.json")
    assert SUITES[name].name == name


@pytest.mark.parametrize("name", suites.NAMES)
def test_the_recipe_gives_the_frozen_suite(name):
    recipe = freeze_suites.recipes()[name]
    assert freeze_suites.frozen(name, recipe).text() == SUITES[name].text()


def test_even_cells_have_whole_losses_only():
    cells = freeze_suites.even_cells(4, 0.05, 0.2)
    lost = [severity for fault, severity in cells if fault.startswith("propeller_loss")]
    assert lost == [1.0] * 8
    damaged = [severity for fault, severity in cells if fault == "propeller_damage:port"]
    np.testing.assert_allclose(damaged, [0.06875, 0.10625, 0.14375, 0.18125])


def test_no_vehicle_serves_twice():
    taken = [(suite.episodes[0].seed, suite.episodes[-1].seed) for suite in SUITES.values()]
    taken += [
        (suite.healthy["counting"], suite.healthy["counting"] + 2_000_000)
        for suite in SUITES.values()
    ]
    taken += [
        (
            SUITES["standard"].healthy["threshold"],
            SUITES["standard"].healthy["threshold"] + 2_000_000,
        )
    ]
    bounds = np.array(sorted(taken))
    assert (bounds[1:, 0] > bounds[:-1, 1]).all()
    assert {purpose_of(int(seed)) for seed in bounds.ravel()} == {"test"}
    assert len({suite.healthy["threshold"] for suite in SUITES.values()}) == 1


def events(name, which=0):
    return [episode.schedule[which] for episode in SUITES[name].episodes]


@pytest.mark.parametrize("name", ["ideal", "standard"])
def test_there_are_as_many_of_every_class_and_severities_are_evenly_spread(name):
    found = events(name)
    assert len(found) == 2052
    for diagnosis in classes()[1:-1]:
        of_class = [event for event in found if CATALOGUE[event.fault].diagnosis == diagnosis]
        assert len(of_class) == 114
        kinds = [
            sum(event.fault == kind for event in of_class)
            for kind in {event.fault for event in of_class}
        ]
        assert max(kinds) - min(kinds) <= 1
        for kind in {event.fault for event in of_class}:
            severities = np.sort([event.severity for event in of_class if event.fault == kind])
            even = 0.2 + 0.8 * (np.arange(len(severities)) + 0.5) / len(severities)
            if name == "standard" and kind.startswith("propeller_loss"):
                even = np.ones_like(even)
            np.testing.assert_allclose(severities, even, atol=1e-4)
    assert all(5.0 <= event.onset <= 30.0 for event in found)
    assert 0.2 < np.mean([event.ramp > 0.0 for event in found]) < 0.3


def test_half_of_the_standard_missions_keep_their_speed():
    legs = [episode.mission.legs for episode in SUITES["standard"].episodes]
    constant = [leg[0][1] for leg in legs if len(leg) == 1]
    assert len(constant) == len(legs) // 2
    assert 0.2 <= min(constant) and max(constant) <= 0.5


def test_a_third_of_the_lanes_is_steered_within_its_deflection():
    conditions = SUITES["standard"].conditions
    samples = np.arange(650)
    deflections = conditions.deflections(range(300), samples)
    assert deflections.shape == (650, 300, 2)
    assert 0.25 < deflections.any(axis=(0, 2)).mean() < 0.42
    assert np.abs(deflections).max() <= 0.3
    np.testing.assert_array_equal(
        conditions.deflections(range(7, 9), samples[300:]), deflections[300:, 7:9]
    )


def test_shifts_shift_what_they_say():
    plant = {name: SUITES[name].conditions.plant for name in suites.NAMES}
    shifts = {
        "ood_sensors": "realism",
        "ood_noise": "sensor_noise",
        "ood_disturbance": "disturbance",
        "ood_vehicle": "healthy_band",
    }
    for name, key in shifts.items():
        # a shift differs from the standard in one thing
        assert plant[name] == plant["standard"] | {key: 2.0}
    assert plant["standard"]["realism"] == 1.0 and "realism" not in plant["ideal"]
    assert all(0.05 <= event.severity <= 0.2 for event in events("ood_severity"))
    for first, second in zip(events("ood_compound"), events("ood_compound", 1), strict=True):
        assert 2.0 <= second.onset - first.onset <= 10.0
        assert second.severity < first.severity
        assert CATALOGUE[first.fault].diagnosis != CATALOGUE[second.fault].diagnosis
    legs = [leg for episode in SUITES["ood_mission"].episodes for leg in episode.mission.legs]
    assert min(speed for _, speed in legs) >= 0.5 and max(speed for _, speed in legs) <= 0.9
    counts = {name: len(SUITES[name].episodes) for name in suites.NAMES if name.startswith("ood")}
    # a propeller is lost as a whole or not
    assert counts.pop("ood_severity") == 352
    assert set(counts.values()) == {396}


def test_faults_that_no_class_describes():
    found = [episode.schedule for episode in SUITES["unknown_faults"].episodes]
    alone = [events[0] for events in found if len(events) == 1]
    assert {event.fault for event in alone} == set(UNMODELLED)
    pairs = [events for events in found if len(events) == 2]
    assert len(pairs) == 88 and len(alone) == 22 * len(UNMODELLED)
    for first, second in pairs:
        assert first.fault.replace(":port", "") == second.fault.replace(":starboard", "")
        assert first.onset == second.onset and first.severity == second.severity


def test_long_missions_have_late_onsets():
    onsets = [event.onset for event in events("long")]
    assert SUITES["long"].conditions.duration == 1200.0
    assert 60.0 <= min(onsets) < 120.0 and 1100.0 < max(onsets) <= 1160.0


def test_healthy_hours_are_whole_missions_but_of_the_ideal_suites():
    without = [name for name in suites.NAMES if not SUITES[name].conditions.whole_missions]
    assert without == ["thesis", "ideal"]


def test_any_changed_byte_is_refused(tmp_path):
    path = tmp_path / "mine.json"
    text = small(1).text().encode()
    for k in range(len(text)):
        path.write_bytes(text[:k] + bytes([text[k] ^ 1]) + text[k + 1 :])
        with pytest.raises(InputError, match=r"mine\.json") as refused:
            suites.load(str(path))
        assert "\n" not in str(refused.value)
    path.write_bytes(text)
    assert suites.load(str(path)).episodes == small(1).episodes


def test_the_refusal_names_both_hashes_and_the_remedy(tmp_path):
    path = written(tmp_path / "mine.json", small())
    text = suites.read(path := tmp_path / "mine.json")
    path.write_text(text.replace("nominal vehicles", "nominal Vehicles"), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        suites.load(str(path))
    wanted = suites.CLOSING.search(text)[1]
    assert wanted in str(refused.value)
    assert suites.digest(suites.read(path).split(' "hash"')[0]) in str(refused.value)
    assert "freeze_suites" in str(refused.value)
    freeze_suites.main([str(path)])
    assert suites.load(str(path)).about.endswith("nominal Vehicles at its mean speed")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"seed": 4', '"seed": 1', []),
        ("[4000000000, ", "[3000000000, ", ["seed of an episode", "3000000000"]),
        ('"duration": 65.0', '"duration": 12.0', ["duration", "12"]),
        ('"preset": "thesis1992"', '"preset": "thesis1993"', ["thesis1993"]),
        ('"counting"', '"count"', ["first seed of counting", "None"]),
        ('"columns"', '"collumns"', []),
        ('"missions"', '"mission"', ["KeyError", "missions"]),
        ('"missions": [', '"missions": [], "was": [', ["missions", "at least one"]),
        ('"episodes": [', '"episodes": [], "were": [', ["episodes", "at least one"]),
        ('"name": "thesis"', '"name": "../thesis"', ["name", "../thesis"]),
        (
            '"counting": 4010000000',
            '"counting": 18446744073709551615',
            ["first seed of counting", "test seed"],
        ),
        ('"onset": ', '"onset": 9', ["first onset", "to 34.9"]),
    ],
)
def test_a_sealed_file_that_makes_no_sense_is_refused_with_the_place(tmp_path, old, new, words):
    body = small().text().split(' "hash"')[0].replace(old, new)
    path = tmp_path / "mine.json"
    path.write_text(suites.sealed(body), encoding="utf-8")
    if not words:
        suites.load(str(path))
        return
    with pytest.raises(InputError) as refused:
        suites.load(str(path))
    for word in ("mine.json", *words):
        assert word in str(refused.value)


def test_a_faulty_episode_has_a_fault():
    first = small(1).episodes[0]
    for schedule in ((), tuple(replace(event, severity=0.0) for event in first.schedule)):
        with pytest.raises(InputError, match="its severity above 0"):
            small(episodes=(first._replace(schedule=schedule),))


@pytest.mark.parametrize("content", ["", "{", "[]", "[1]", "null"])
def test_what_is_no_suite_is_refused(tmp_path, content):
    path = tmp_path / "mine.json"
    path.write_text(content, encoding="utf-8")
    for attempt in (suites.load, lambda name: freeze_suites.main([name])):
        with pytest.raises(InputError, match=r"mine\.json"):
            attempt(str(path))


@pytest.mark.parametrize(
    ("name", "word"),
    [("standart", "did you mean 'standard'"), ("absent.json", "check the path"), ("", "FILE.json")],
)
def test_an_unknown_suite_is_refused(name, word):
    with pytest.raises(InputError, match=word):
        suites.load(name)
