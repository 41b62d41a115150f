"""The live page: controls, verdict, charts and advice around a `Session`, drawn anew every 0.4 s."""

from collections.abc import Callable, Sequence

from nicegui import run, ui

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE, NORMAL
from auv_fault_env.parameters import SAMPLE_RATE
from training.live import words
from training.live.charts import CHARTS
from training.live.session import DIAGNOSERS, SLOWEST, Session
from training.stimuli import STIMULI

TICK = 0.4  # s between two drawings: a browser without a graphics card keeps up
PACES = {1: "1×", 4: "4×", 10: "10×"}  # times real time
GROWTH = {0.0: "abrupt", 10.0: "over 10 s", 30.0: "over 30 s"}
COLOURS = {
    "continue": "positive",
    "derate": "warning",
    "return": "deep-orange",
    "abort": "negative",
}


def places() -> dict[str, list[str]]:
    """Where each kind of fault of the catalogue may strike; an empty name where there is no choice."""
    found: dict[str, list[str]] = {}
    for name in CATALOGUE:
        kind, _, place = name.partition(":")
        found.setdefault(kind, []).append(place)
    return found


class Page:
    """A visitor's page with a vehicle of its own, which goes when the page is left."""

    def __init__(self, seed: int):
        self.session = Session(seed)
        self.running = False
        ui.context.client.content.classes("p-2")
        with ui.dialog().props("persistent") as self.wait:
            ui.spinner(size="xl", color="white")
        with ui.element("div").classes("w-full grid gap-2 lg:grid-cols-[16rem_1fr]"):
            with ui.element("div").classes(
                "grid gap-2 content-start md:grid-cols-3 lg:grid-cols-1"
            ):
                self._control_vehicle()
                self._control_fault()
                self._control_diagnosis()
            with ui.element("div").classes(
                "grid gap-2 content-start grid-cols-1 md:grid-cols-2 lg:grid-cols-3"
            ):
                self._show_verdict()
                self.charts = {name: _chart() for name in CHARTS}
                self.advice = _text("advice")
                self.truth = _text("truth")
        self.draw()
        ui.timer(TICK, self._tick)

    def _control_vehicle(self) -> None:
        with _card("vehicle: a simulated NPS AUV II"):
            with ui.row().classes("gap-2"):
                self.start = ui.button("start", on_click=self._start_or_pause).mark("start")
                ui.button("reset", on_click=self._doing(self.session.reset)).props("outline").mark(
                    "reset"
                )
            with ui.row().classes("gap-2 items-center"):
                self.pace = ui.toggle(PACES, value=1).props("dense no-caps").mark("pace")
                self.progress = ui.label().mark("progress")
            speed = _slider(
                "mission speed [m/s]", SLOWEST, MAXIMUM_COMMAND, self.session.mission_speed
            ).mark("speed")
            speed.on_value_change(lambda event: self.session.set_mission_speed(event.value))

    def _control_fault(self) -> None:
        options = places()
        with _card("fault"):
            kind = _select("kind", options, "propeller_loss")
            place = _select("place", options[kind.value], "port")
            severity = _slider("severity", 0.05, 1.0, 1.0).mark("severity")
            growth = ui.toggle(GROWTH, value=0.0).props("dense no-caps").mark("growth")

            def show_places() -> None:
                place.set_options(options[kind.value], value=options[kind.value][0])
                place.set_visibility(bool(place.value))

            def inject() -> None:
                fault = ":".join(filter(None, (kind.value, place.value)))
                self.session.inject(fault, severity.value, growth.value)

            kind.on_value_change(show_places)
            with ui.row().classes("gap-2"):
                ui.button("inject", on_click=self._doing(inject), color="negative").mark("inject")
                ui.button("repair", on_click=self._doing(self.session.repair)).props(
                    "outline"
                ).mark("repair")
            surprise = ui.button("surprise me", on_click=self._doing(self.session.surprise)).props(
                "flat dense"
            )
            surprise.mark("surprise").tooltip("a fault that nobody has chosen")

    def _control_diagnosis(self) -> None:
        with _card("diagnosis"):
            self.diagnoser = _select("diagnoser", DIAGNOSERS, self.session.diagnoser.name)
            self.diagnoser.on_value_change(
                lambda event: self._choose(self.session.choose_diagnoser, event.value)
            )
            self.stimulus = _select("stimulus", STIMULI, self.session.stimulus.name)
            self.stimulus.on_value_change(
                lambda event: self._choose(self.session.choose_stimulus, event.value)
            )
            self.shows_truth = ui.switch("show the truth", on_change=self.draw).mark("show-truth")

    def _show_verdict(self) -> None:
        with ui.card().props("flat bordered").classes("p-2 col-span-full"):
            with ui.row().classes("w-full items-center gap-3"):
                self.alarm, self.action = (
                    ui.badge().classes("text-base p-2").mark(name) for name in ("alarm", "action")
                )
                self.belief = ui.label().mark("belief")

    def _start_or_pause(self) -> None:
        self.running = not self.running
        self.start.set_text("pause" if self.running else "start")

    def _doing(self, action: Callable[[], None]) -> Callable[[], None]:
        """The action, after which the page is drawn."""

        def do() -> None:
            action()
            self.draw()

        return do

    async def _choose(self, choose: Callable[[str], None], name: str) -> None:
        """In a thread, for it may have to load a network or to work out a wave, while the page waits."""
        self.wait.open()
        try:
            await run.io_bound(choose, name)
        except InputError as error:
            ui.notify(str(error), type="negative")
        self.wait.close()
        self.diagnoser.value = self.session.diagnoser.name
        self.stimulus.value = self.session.stimulus.name
        self.draw()

    def _tick(self) -> None:
        if self.running and not self.wait.value:
            for _ in range(round(TICK * SAMPLE_RATE) * self.pace.value):
                self.session.step()
            self.draw()

    def draw(self) -> None:
        """Bring what is shown up to date."""
        history = self.session.history()
        session = self.session
        for name, chart in self.charts.items():
            chart.options.update(CHARTS[name](history, self.shows_truth.value))
            chart.update()
        quiet = history.verdict == NORMAL
        _badge(
            self.alarm,
            "no alarm" if quiet else f"alarm: {history.verdict}",
            "positive" if quiet else "negative",
        )
        action = str(session.advice.action[0])
        _badge(self.action, f"advice: {action}", COLOURS[action])
        self.belief.set_text(words.believed(history))
        self.progress.set_text(f"{session.time:.1f} s, {session.travelled:.0f} m")
        self.advice.set_text(words.advised(session.advice))
        self.truth.set_text(words.true(session.truth()) if self.shows_truth.value else "hidden")


def _card(title: str) -> ui.card:
    card = ui.card().props("flat bordered").classes("p-2 gap-1")
    with card:
        ui.label(title).classes("text-weight-medium")
    return card


def _text(title: str) -> ui.label:
    with _card(title):
        return ui.label().classes("whitespace-pre-line text-sm").mark(title)


def _chart() -> ui.echart:
    with ui.card().props("flat bordered").classes("p-0"):
        return ui.echart({}).classes("w-full h-60")


def _select(name: str, options: Sequence[str], value: str) -> ui.select:
    return (
        ui.select(list(options), value=value, label=name)
        .props("dense")
        .classes("w-full")
        .mark(name)
    )


def _slider(name: str, low: float, high: float, value: float) -> ui.slider:
    label = ui.label()
    slider = ui.slider(min=low, max=high, step=0.05, value=value).classes("px-2")
    label.bind_text_from(slider, "value", lambda now: f"{name}: {now:.2f}")
    return slider


def _badge(badge: ui.badge, text: str, colour: str) -> None:
    badge.set_text(text)
    badge.props(f"color={colour}")
