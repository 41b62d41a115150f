import asyncio

from nicegui.testing.user_simulation import user_simulation

from training.live.start import Preparation, show_page


class Unfinished:
    """A preparation that ends when the test says so."""

    is_over = False


def test_the_page_says_what_it_waits_for_and_appears_by_itself():
    preparation = Unfinished()

    async def visited():
        root = lambda: show_page(1, preparation, "compiling")  # noqa: E731
        async with user_simulation(root=root) as user:
            await user.open("/")
            await user.should_see("Compiling. The page appears by itself.")
            await user.should_not_see("no alarm")
            preparation.is_over = True
            await user.should_see("no alarm", retries=100)
            await user.should_not_see("Compiling")

    asyncio.run(visited())


def test_a_preparation_that_fails_is_over(monkeypatch, capsys):
    def fail(seed):
        raise ValueError(seed)

    monkeypatch.setattr("training.live.start.Session", fail)
    monkeypatch.setattr("threading.excepthook", lambda _: None)
    preparation = Preparation(1)
    assert preparation._is_over.wait(10.0)
    assert preparation.is_over
