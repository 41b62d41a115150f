import asyncio

import pytest
from nicegui.testing.user_simulation import user_simulation

from auv_fault_env.faults import CATALOGUE
from training.live.page import Page, fault_places


def visit(act):
    """Open the page in a simulated browser and do something with it: `act(user, page)`."""

    async def visited():
        pages = []
        async with user_simulation(root=lambda: pages.append(Page(1))) as user:
            await user.open("/")
            await act(user, pages[0])

    asyncio.run(visited())


def only(user, marker):
    (element,) = user.find(marker=marker).elements
    return element


async def until(condition, seconds=30.0):
    for _ in range(round(seconds / 0.05)):
        if condition():
            return
        await asyncio.sleep(0.05)
    raise AssertionError(f"not within {seconds:g} s")


def test_a_person_breaks_the_vehicle_and_sees_it_named():
    async def act(user, page):
        await user.should_see("no alarm")
        await user.should_see("hidden")
        only(user, "pace").value = 10
        user.find("start").click()
        user.find("inject").click()
        await until(lambda: only(user, "alarm").text == "alarm: propeller_loss:port")
        assert page.session.history().alarms()[0][0] <= 10.0
        assert only(user, "action").text.startswith("advice: ")
        assert only(user, "belief").text.count("propeller_loss:port") == 1
        user.find("show-truth").click()
        await user.should_see("propeller_loss:port, severity 1.00")
        user.find("pause").click()
        user.find("repair").click()
        page.session.step()
        page.update()
        await user.should_see("The vehicle is healthy.")
        user.find("reset").click()
        await user.should_see("0.0 s, 0 of 2000 m")

    visit(act)


def test_controls_reach_the_vehicle():
    async def act(user, page):
        only(user, "speed").value = 0.5
        assert page.session.mission_speed == 0.5
        only(user, "kind").value = "sensor_bias"
        only(user, "place").value = "port_rpm"
        only(user, "severity").value = 0.4
        only(user, "ramp").value = 10.0
        user.find("inject").click()
        (event,) = page.session.faults.values()
        assert (event.fault, event.severity, event.ramp) == ("sensor_bias:port_rpm", 0.4, 10.0)
        place = only(user, "place")
        only(user, "kind").value = "increased_drag"
        assert not place.visible
        user.find("inject").click()
        assert list(page.session.faults) == ["sensor_bias:port_rpm", "increased_drag"]
        user.find("random fault").click()
        assert len(page.session.faults) == 3

    visit(act)


@pytest.mark.parametrize(
    ("control", "name"), [("diagnoser", "integrated"), ("stimulus", "d_optimal")]
)
def test_diagnoser_and_stimulus_are_chosen_while_the_page_waits(control, name):
    async def act(user, page):
        with user:
            only(user, control).value = name
        await until(lambda: getattr(page.session, control).name == name and not page.wait.value)

    visit(act)


def test_each_visitor_has_another_vehicle():
    async def act(user, page):
        page.session.inject("increased_drag")
        await user.open("/")
        await user.should_see("no alarm")

    visit(act)


def test_places_are_those_of_the_catalogue():
    names = [
        ":".join(filter(None, (kind, place)))
        for kind, options in fault_places().items()
        for place in options
    ]
    assert sorted(names) == sorted(CATALOGUE)
