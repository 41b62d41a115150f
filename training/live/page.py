"""The live page: controls, verdict, charts and advice of a `Session`, updated every 0.4 s."""

from collections.abc import Callable, Sequence

from nicegui import run, ui

from auv_fault_env.channels import MAXIMUM_COMMAND
from auv_fault_env.errors import InputError
from auv_fault_env.faults import CATALOGUE
from auv_fault_env.parameters import SAMPLE_RATE
from training.live import texts
from training.live.badges import CAUTION, Badge, badges
from training.live.charts import CHARTS
from training.live.session import DIAGNOSERS, DISTANCE_TO_GOAL, SLOWEST, Session
from training.stimuli import STIMULI

UPDATE_INTERVAL = 0.4  # s, long enough for a browser without a graphics card
PACES = {1: "1×", 4: "4×", 10: "10×"}  # times real time
FIRST_PACE = 1
RAMPS = {0.0: "abrupt", 10.0: "over 10 s", 30.0: "over 30 s"}
CONTROLS_GRID = "grid gap-2 content-start md:grid-cols-3 lg:grid-cols-1"
CHARTS_GRID = "grid gap-2 content-start grid-cols-1 md:grid-cols-2 lg:grid-cols-3"


def fault_places() -> dict[str, list[str]]:
    """Places of each kind of fault in the catalogue; an empty name where there is only one."""
    places: dict[str, list[str]] = {}
    for name in CATALOGUE:
        kind, _, place = name.partition(":")
        places.setdefault(kind, []).append(place)
    return places


class Page:
    """The page of one visitor, with its own vehicle."""

    def __init__(self, seed: int):
        self.session = Session(seed)
        self.is_running = False
        self._is_choosing = False
        ui.context.client.content.classes("p-2")
        with ui.dialog().props("persistent") as self.wait:
            ui.spinner(size="xl", color="white")
        with ui.element("div").classes("w-full grid gap-2 lg:grid-cols-[16rem_1fr]"):
            with ui.element("div").classes(CONTROLS_GRID):
                self._control_vehicle()
                self._control_fault()
                self._control_diagnosis()
            with ui.element("div").classes(CHARTS_GRID):
                self._show_verdict()
                self.charts = {name: _chart() for name in CHARTS}
                self.advice = _text("advice", "advice, with 95 % intervals")
                self.truth = _text("truth", "truth")
        self.update()
        ui.timer(UPDATE_INTERVAL, self._run)

    def _control_vehicle(self) -> None:
        with _card("vehicle: a simulated NPS AUV II"):
            with ui.row().classes("gap-2"):
                self.start = _button("start", self._start_or_pause)
                _button("reset", self._and_update(self.session.reset)).props("outline")
            with ui.row().classes("gap-2 items-center"):
                self.pace = ui.toggle(PACES, value=FIRST_PACE).props("dense no-caps").mark("pace")
                self.progress = ui.label().mark("progress")
            first = self.session.mission_speed
            speed = _slider("mission speed [m/s]", SLOWEST, MAXIMUM_COMMAND, first).mark("speed")
            speed.on_value_change(lambda event: self.session.set_mission_speed(event.value))

    def _control_fault(self) -> None:
        places = fault_places()
        with _card("fault"):
            kind = _select("kind", places, "propeller_loss")
            place = _select("place", places[kind.value], "port")
            severity = _slider("severity", 0.05, 1.0, 1.0).mark("severity")
            ramp = ui.toggle(RAMPS, value=0.0).props("dense no-caps").mark("ramp")

            def show_places() -> None:
                place.set_options(places[kind.value], value=places[kind.value][0])
                place.set_visibility(bool(place.value))

            def inject() -> None:
                fault = ":".join(filter(None, (kind.value, place.value)))
                self.session.inject(fault, severity.value, ramp.value)

            kind.on_value_change(show_places)
            with ui.row().classes("gap-2"):
                _button("inject", self._and_update(inject)).props("color=negative")
                _button("repair", self._and_update(self.session.repair)).props("outline")
            random = _button("random fault", self._and_update(self.session.inject_random_fault))
            random.props("flat dense").tooltip("its kind, place and severity stay hidden")

    def _control_diagnosis(self) -> None:
        with _card("diagnosis"):
            session = self.session
            self.diagnoser = _select("diagnoser", DIAGNOSERS, session.diagnoser.name)
            self.stimulus = _select("stimulus", STIMULI, session.stimulus.name)
            self._on_choice(self.diagnoser, session.choose_diagnoser)
            self._on_choice(self.stimulus, session.choose_stimulus)
            self.shows_truth = ui.switch("show the truth", on_change=self.update).mark("show-truth")

    def _show_verdict(self) -> None:
        with ui.card().props("flat bordered").classes("p-2 col-span-full"):
            with ui.row().classes("w-full items-center gap-3"):
                self.alarm = ui.badge().classes("text-base p-2").mark("alarm")
                self.action = ui.badge().classes("text-base p-2").mark("action")
                self.belief = ui.label().mark("belief")

    def _start_or_pause(self) -> None:
        self.is_running = not self.is_running
        self.start.set_text("pause" if self.is_running else "start")

    def _and_update(self, action: Callable[[], None]) -> Callable[[], None]:
        """The action, followed by an update of the page; none while a choice is under way.

        The dialog of the choice blocks the page, but a forged message comes through.
        """

        def act() -> None:
            if not self._is_choosing:
                action()
                self.update()

        return act

    def _on_choice(self, select: ui.select, choose: Callable[[str], None]) -> None:
        select.on_value_change(lambda event: self._choose(choose, event.value))

    async def _choose(self, choose: Callable[[str], None], name: str) -> None:
        """Choose in a thread, because that may load a network or compute a wave."""
        if self._is_choosing:
            return
        self._is_choosing = True
        self.wait.open()
        try:
            await run.io_bound(choose, name)
        except InputError as error:
            ui.notify(str(error), type="negative")
        finally:
            self.wait.close()
            self.diagnoser.value = self.session.diagnoser.name
            self.stimulus.value = self.session.stimulus.name
            self._is_choosing = False
        self.update()

    def _run(self) -> None:
        if self.is_running and not self._is_choosing:
            pace = self.pace.value or FIRST_PACE
            for _ in range(round(UPDATE_INTERVAL * SAMPLE_RATE) * pace):
                self.session.step()
            self.update()

    def update(self) -> None:
        """Show the present state of the session."""
        history = self.session.history()
        session = self.session
        for name, chart in self.charts.items():
            chart.options.update(CHARTS[name](history, self.shows_truth.value))
            chart.update()
        alarm, advice = badges(history.verdict, str(session.advice.action[0]))
        _show_badge(self.alarm, alarm)
        _show_badge(self.action, advice)
        self.belief.set_text(texts.belief_text(history))
        way = f"{session.travelled:.0f} of {DISTANCE_TO_GOAL:.0f} m"
        self.progress.set_text(f"{session.time:.1f} s, {way}")
        self.advice.set_text(texts.advice_text(session.advice))
        is_shown = self.shows_truth.value
        self.truth.set_text(texts.truth_text(session.truth()) if is_shown else texts.HIDDEN_TRUTH)


def _button(text: str, action: Callable[[], None]) -> ui.button:
    return ui.button(text, on_click=action).mark(text)


def _card(title: str) -> ui.card:
    card = ui.card().props("flat bordered").classes("p-2 gap-1")
    with card:
        ui.label(title).classes("text-weight-medium")
    return card


def _text(name: str, title: str) -> ui.label:
    with _card(title):
        return ui.label().classes("whitespace-pre-line text-sm").mark(name)


def _chart() -> ui.echart:
    with ui.card().props("flat bordered").classes("p-0"):
        return ui.echart({}).classes("w-full h-60")


def _select(name: str, options: Sequence[str], value: str) -> ui.select:
    select = ui.select(list(options), value=value, label=name)
    return select.props("dense").classes("w-full").mark(name)


def _slider(name: str, low: float, high: float, value: float) -> ui.slider:
    label = ui.label()
    slider = ui.slider(min=low, max=high, step=0.05, value=value).classes("px-2")
    label.bind_text_from(slider, "value", lambda now: f"{name}: {now:.2f}")
    return slider


def _show_badge(element: ui.badge, badge: Badge) -> None:
    element.set_text(badge.text)
    text_colour = "black" if badge.colour == CAUTION else "white"
    element.props(f"color={badge.colour} text-color={text_colour}")
