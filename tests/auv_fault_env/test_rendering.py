"""Frames: what they show, what they must not tell, and that no display is needed for them."""

import subprocess
import sys
import time
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils import env_checker

import auv_fault_env
from auv_fault_env import CATALOGUE, CHANNELS, PRESETS, Fault
from auv_fault_env.canvas import SIZE
from auv_fault_env.charts import ticks
from auv_fault_env.faults import UNKNOWN, fault_classes
from auv_fault_env.palette import PALE_WARNING, WARNING
from auv_fault_env.rendering import Renderer
from auv_fault_env.silhouette import vehicle_parts

ID = "auv_fault_env/Propulsion-v0"
HEALTHY = {"port_beta": 1e-7, "starboard_beta": 1e-7}
VEHICLE = (slice(0, 232), slice(0, 430))  # the views from above and from starboard
ASTERN = (slice(30, 190), slice(440, 660))
CAPTION = (slice(110, 232), slice(664, 960))
CHART_ROWS = slice(240, 640)


def make(mode="rgb_array"):
    return gym.make(ID, render_mode=mode).unwrapped


def start(env, schedule=(), seed=5, mission="thesis"):
    return env.reset(seed=seed, options={"schedule": list(schedule), "mission": mission})


def advance(env, steps, rudder=0.0):
    for _ in range(steps):
        env.step([0.3, rudder, 0.0])


def event(fault, onset, severity=1.0):
    return {"fault": fault, "onset": onset, "severity": severity}


def truth(severity=None, parameters=HEALTHY, rpm=300.0):
    state = {"speed": 0.3, "port_rpm": rpm, "starboard_rpm": rpm}
    return {"severity": severity or {}, "parameters": parameters, "state": state}


def frame_of(severity=None, parameters=HEALTHY):
    renderer = Renderer("rgb_array", 10, PRESETS["thesis1992"])
    renderer.record(0.0, np.zeros(len(CHANNELS), np.float32), truth(severity, parameters))
    return renderer.frame()


def warned(frame, region):
    return int(
        sum((frame[region] == colour).all(axis=-1).sum() for colour in (WARNING, PALE_WARNING))
    )


@pytest.fixture
def dummy_display(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def test_frame_is_an_rgb_array_from_the_first_moment_on():
    env = make()
    start(env)
    frame = env.render()
    assert (frame.shape, frame.dtype) == ((SIZE[1], SIZE[0], 3), np.uint8)
    assert frame.flags.writeable and frame.std() > 5.0


def test_frames_differ_over_time_and_are_not_shared():
    env = make()
    start(env)
    first = env.render()
    kept = first.copy()
    advance(env, 1)
    assert (env.render() != kept).any()
    np.testing.assert_array_equal(first, kept)


def test_rendering_twice_gives_the_same_picture():
    env = make()
    start(env, [event("sensor_noise:speed", 0.2)])
    advance(env, 10)
    np.testing.assert_array_equal(env.render(), env.render())


def test_rendering_does_not_touch_the_episode():
    seen = make()
    blind = gym.make(ID).unwrapped
    start(seen), start(blind)
    for _ in range(5):
        seen.render()
        np.testing.assert_array_equal(seen.step([0.3, 0.1, 0.0])[0], blind.step([0.3, 0.1, 0.0])[0])


def test_future_onset_is_not_drawn():
    faulty = make()
    twin = make()
    start(faulty, [event("propeller_loss:port", 1.0), event("sensor_bias:speed", 2.0)]), start(twin)
    for _ in range(11):
        np.testing.assert_array_equal(faulty.render(), twin.render())
        advance(faulty, 1), advance(twin, 1)
    assert (faulty.render() != twin.render()).any()


def test_reset_empties_the_charts_and_forgets_the_faults():
    used = make()
    fresh = make()
    start(used, [event("increased_drag", 0.0)], seed=1)
    advance(used, 20)
    start(used), start(fresh)
    np.testing.assert_array_equal(used.render(), fresh.render())


def test_deflected_rudder_shows_from_above():
    still = make()
    turning = make()
    start(still), start(turning)
    advance(still, 3), advance(turning, 3, rudder=0.4)
    assert (still.render()[VEHICLE] != turning.render()[VEHICLE]).any()


def test_propellers_turn_and_stand_still():
    renderer = Renderer("rgb_array", 10, PRESETS["thesis1992"])
    frames = []
    for step, rpm in enumerate((300.0, 300.0, 0.0)):
        renderer.record(step / 10, np.zeros(len(CHANNELS)), truth(rpm=rpm))
        frames.append(renderer.frame()[ASTERN])
    assert (frames[0] != frames[1]).any()
    np.testing.assert_array_equal(frames[1], frames[2])


def test_healthy_vehicle_warns_of_nothing():
    assert warned(frame_of(), ...) == 0


@pytest.mark.parametrize("diagnosis", fault_classes())
def test_every_diagnosis_shows_on_the_vehicle_and_in_the_caption(diagnosis):
    frame = frame_of({diagnosis: 0.5})
    assert warned(frame, VEHICLE) > 4
    assert warned(frame, CAPTION) > 1000


def test_an_unknown_fault_shows_in_the_caption_alone():
    frame = frame_of({UNKNOWN: 0.5})
    assert warned(frame, VEHICLE) == 0
    assert warned(frame, CAPTION) > 1000


@pytest.mark.parametrize("channel", auv_fault_env.channels.READINGS)
def test_faulty_sensor_shows_at_its_chart(channel):
    assert warned(frame_of({f"sensor:{channel}": 0.5}), CHART_ROWS) > 100


def test_every_component_of_the_catalogue_is_drawn():
    both = {"port": 0.0, "starboard": 0.0}
    drawn = {part.component for part in vehicle_parts(0.0, 0.0, both, both)}
    assert {fault.component for fault in CATALOGUE.values()} <= drawn


def test_new_fault_shows_without_an_edit(monkeypatch):
    monkeypatch.setitem(CATALOGUE, "ice_on_hull", Fault("ice_on_hull", "hull", {"alpha": 1.4}))
    hull = frame_of({"ice_on_hull": 0.5})
    np.testing.assert_array_equal(hull[VEHICLE], frame_of({"increased_drag": 0.5})[VEHICLE])
    assert (hull[CAPTION] != frame_of({"increased_drag": 0.5})[CAPTION]).any()


def test_fault_of_an_unknown_component_still_has_its_caption(monkeypatch):
    monkeypatch.setitem(CATALOGUE, "flat_battery", Fault("flat_battery", "battery"))
    assert warned(frame_of({"flat_battery": 0.5}), CAPTION) > 1000


def test_all_faults_at_once_fit_the_caption():
    frame = frame_of(dict.fromkeys(auv_fault_env.classes()[1:], 1.0))
    few = frame_of(dict.fromkeys(auv_fault_env.classes()[1:5], 1.0))
    assert warned(frame, (slice(222, 240), slice(664, 960))) == 0
    assert warned(few, CAPTION) > 0.9 * warned(frame, CAPTION)


def test_lost_propeller_is_missing_and_a_damaged_one_is_shorter():
    def blades(share):
        both = {"port": 1.0, "starboard": share}
        parts = vehicle_parts(0.0, 0.0, {"port": 0.0, "starboard": 0.0}, both)
        return [
            np.ptp(part.corners[:, 2]) for part in parts if part.component == "propeller:starboard"
        ]

    whole = blades(1.0)
    damaged = blades(0.5)
    lost = blades(0.0)
    assert len(lost) == 1, "only the empty disc remains"
    assert damaged[1] == pytest.approx(whole[1] / 2)


def test_onset_is_marked_where_the_fault_struck_and_leaves_with_the_minute():
    renderer = Renderer("rgb_array", 10, PRESETS["thesis1992"])
    for step in range(1300):
        severity = {"increased_drag": 0.5} if 200 <= step < 300 else {}
        renderer.record(step / 10, np.zeros(len(CHANNELS)), truth(severity))
        if step in (190, 400, 1299):
            columns = (renderer.frame()[CHART_ROWS, :480] == WARNING).all(axis=-1).any(axis=0)
            expected = {190: [], 400: [193, 194], 1299: []}[step]
            np.testing.assert_array_equal(np.flatnonzero(columns), expected)


@pytest.mark.parametrize(
    "low, high", [(0.0, 1.0), (-0.03, 0.02), (1234.0, 1234.5), (-1.0, 6000.0), (0.1, 0.3)]
)
def test_ticks_enclose_the_range_in_round_steps(low, high):
    marks = ticks(low, high)
    step = marks[1] - marks[0]
    assert marks[0] <= low + 0.02 * step and marks[-1] >= high - 0.02 * step
    assert 3 <= len(marks) <= 7
    assert float(f"{step:.0e}") == pytest.approx(step) and f"{step:e}"[0] in "125"


def test_another_user_of_pygame_may_quit_it():
    import pygame

    env = make()
    start(env)
    before = env.render()
    pygame.quit()
    advance(env, 1)
    assert env.render().shape == before.shape
    start(env)
    np.testing.assert_array_equal(env.render(), before)


def test_no_display_is_opened_off_screen():
    import pygame

    env = make()
    start(env)
    env.render()
    assert not pygame.display.get_init()
    assert pygame.mixer is None or not pygame.mixer.get_init()


def test_importing_the_package_and_stepping_leaves_pygame_alone():
    code = (
        "import sys, auv_fault_env, auv_fault_env.env, auv_fault_env.rendering\n"
        "assert 'pygame' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_missing_pygame_is_named_with_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(
        gym.error.DependencyNotInstalled, match=r'pip install "auv-fault\[render\]"'
    ):
        Renderer("rgb_array", 10, PRESETS["thesis1992"])


def test_window_follows_the_episode_and_its_rate(dummy_display):
    import pygame

    env = make("human")
    start(env)
    begin = time.perf_counter()
    advance(env, 4)
    assert time.perf_counter() - begin > 0.3
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    twin = make()
    start(twin), advance(twin, 4)
    np.testing.assert_array_equal(shown, twin.render())
    assert env.render() is None
    env.close()
    assert not pygame.display.get_init()
    env.close()


def test_user_may_close_the_window(dummy_display):
    import pygame

    env = make("human")
    start(env)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    advance(env, 3)
    assert not pygame.display.get_init()
    start(env), advance(env, 2)
    assert env.render() is None
    env.close()


def test_env_checker_passes_with_rendering(dummy_display):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env_checker.check_env(gym.make(ID).unwrapped)
        env_checker.check_env(make())
