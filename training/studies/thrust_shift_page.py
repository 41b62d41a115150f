"""The page of ``python -m training.studies.thrust_shift``, made from its results alone."""

from collections.abc import Mapping, Sequence
from typing import Any

from training.report.cells import significant, with_interval
from training.report.sections import Section, figure_section, table_section

Results = Mapping[str, Any]
# faults of the figure; those of starboard show a shift to port as one away from the fault
SHOWN = (
    *("increased_drag", "propeller_damage:port", "propeller_damage:starboard"),
    *("motor_overheating:port", "sensor_scale:speed"),
)
CRUISE = "cruise"
SHIFT = "shift of 0.4, alternating"
SAME_ENERGY = "faster, energy of a shift of 0.4"
BAND = "the healthy band"
RULE = "triggered_shift"


def page(results: Results) -> dict[str, Any]:
    """Title, introduction and sections."""
    sections = [_figure(results), _costs(results)]
    sections += [
        _rates(results, severity, knowledge)
        for severity in results["severities"]
        for knowledge in results["knowledge"]
    ]
    return {
        "title": "Thrust shifted between the sides",
        "summary": _summary(results),
        "intro": _intro(results),
        "sections": [*sections, _loop(results)],
    }


def _summary(results: Results) -> list[str]:
    """What a shift brings a propeller and the hull beside the speed, and the rules in the loop."""
    damage = [_gain(results, name, "propeller_damage") for name in (SHIFT, SAME_ENERGY)]
    drag = [_gain(results, name, "increased_drag") for name in (SHIFT, SAME_ENERGY)]
    energy = results["excitations"][SHIFT]["added_energy"]
    loop = results["loop"]
    rule = loop["stimuli"][RULE]
    return [
        "Thrust was shifted between port and starboard at constant speed, and the speed changed, "
        f"on {results['vehicles']} vehicles for each of {len(results['faults'])} faults and each "
        "severity.",
        f"A shift of 0.4 that alternates needs {100.0 * energy:.1f} % more energy per metre; "
        f"where only the healthy band is known it brings {damage[0]:.1f} times the evidence of "
        f"cruise for a damaged propeller, as much energy spent on speed {damage[1]:.1f} times.",
        f"For drag it brings {drag[0]:.2f} times, the speed {drag[1]:.2f} times: the hull does not "
        "see which propeller thrusts.",
        "In the closed loop thrust to the suspected side changes the isolation time of a damaged "
        f"propeller by {_triple(rule['difference'], '+')} s, at "
        f"{100.0 * rule['healthy_energy']:+.1f} % energy on healthy vehicles.",
    ]


def _gain(results: Results, excitation: str, fault: str) -> float:
    """Evidence since the onset relative to that in cruise, mean over the sides of the fault.

    At the largest severity, where only the healthy band is known.
    """
    severity = f"{results['severities'][-1]:g}"
    names = [name for name in results["faults"] if name.partition(":")[0] == fault]

    def total(name: str) -> float:
        rates = results["excitations"][name]["rates"][severity][BAND]
        return sum(rates[one]["since_onset"] for one in names)

    return total(excitation) / total(CRUISE)


def _intro(results: Results) -> list[str]:
    rates = (
        "How fast evidence grows at 1 ft/s when the speed is changed, or thrust is shifted between "
        f"port and starboard at constant speed: natural logarithms per second, of "
        f"{results['vehicles']} vehicles for each fault, over a period of 20 s that begins 10 s "
        "after an abrupt onset. The likelihoods are those of the Gaussian bank, which knows the "
        "onset, not the severity, and of the healthy vehicle either all or only its band. At a "
        "shift of s the port propeller gives 1 + s and the starboard one 1 - s times its share of "
        "the thrust."
    )
    model = (
        "The plant has surge only: the rudder that holds the heading against the moment is an "
        "estimate from the vehicle's published coefficients, and the angle at which a real vehicle "
        "holds it, which shows a lost propeller, is not among the readings."
    )
    return [rates, model]


def _figure(results: Results) -> Section:
    severity = f"{results['severities'][-1]:g}"
    panels: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for fault in SHOWN:
        for knowledge in results["knowledge"]:
            panels[f"{fault}, {knowledge} known"] = _series(results, severity, knowledge, fault)
    caption = (
        "Evidence [nat/s] against a healthy vehicle, mean over the 30 s since the onset, at "
        f"severity {severity}, and the energy that the nominal vehicle needs more for a metre. The "
        "shifts are 0.1, 0.2, 0.4 and 0.8; one to port takes thrust from a fault of starboard."
    )
    heading = "Evidence and energy"
    data = {"panels": panels}
    return figure_section(heading, "evidence_energy", "evidence-energy", caption, data)


def _series(
    results: Results, severity: str, knowledge: str, fault: str
) -> dict[str, list[tuple[float, float]]]:
    """By family of excitations the points (added energy [%], evidence [nat/s]), cruise first."""
    series: dict[str, list[tuple[float, float]]] = {}
    points = {
        name: (
            100.0 * excitation["added_energy"],
            excitation["rates"][severity][knowledge][fault]["since_onset"],
        )
        for name, excitation in results["excitations"].items()
    }
    for name, excitation in results["excitations"].items():
        if excitation["family"]:
            first = [points[CRUISE]]
            series.setdefault(excitation["family"], first).append(points[name])
    return {family: sorted(of_family) for family, of_family in series.items()}


def _costs(results: Results) -> Section:
    rows = [
        [
            name,
            f"{excitation['energy']:.2f}",
            f"{100.0 * excitation['added_energy']:+.1f} %",
            f"{excitation['speed_rms']:.4f}",
            f"{excitation['rudder']:.3f}",
        ]
        for name, excitation in results["excitations"].items()
    ]
    text = "Of the nominal vehicle without noise, over a period."
    columns = ["excitation", "energy [J/m]", "added", "added speed, rms [m/s]", "rudder [rad]"]
    return table_section("Costs", columns, rows, text)


def _rates(results: Results, severity: float, knowledge: str) -> Section:
    rows = [
        [
            name,
            *(
                _rate(excitation["rates"][f"{severity:g}"][knowledge][fault])
                for fault in results["faults"]
            ),
        ]
        for name, excitation in results["excitations"].items()
    ]
    text = (
        "Evidence [nat/s] for the fault of the column against a healthy vehicle, over the 30 s "
        "since the onset and over the last 20 s of them, and over these against the most similar "
        "class of another part. A propeller is lost at severity 1 only."
    )
    heading = f"Rates at severity {severity:g}, {knowledge} known"
    return table_section(heading, ["excitation", *results["faults"]], rows, text)


def _rate(rate: Mapping[str, Any]) -> str:
    rival = f"{rate['rival']} {significant(rate['against_rival'])}"
    return f"{significant(rate['since_onset'])}, {significant(rate['against_normal'])}, {rival}"


def _loop(results: Results) -> Section:
    loop = results["loop"]
    faults = next(iter(loop["stimuli"].values()))["by_fault"]
    rows = [
        [
            name,
            _triple(of_stimulus["isolation"]),
            _triple(of_stimulus["difference"], "+"),
            *(f"{of_stimulus['by_fault'][fault]:.1f}" for fault in faults),
            f"{100.0 * of_stimulus['healthy_energy']:+.1f} %",
            f"{of_stimulus['healthy_speed_rms']:.4f}",
            f"{100.0 * of_stimulus['healthy_suspected']:.2f} %",
        ]
        for name, of_stimulus in loop["stimuli"].items()
    ]
    text = (
        f"Seconds from onset until the right class is the most probable one of {loop['diagnoser']} "
        f"for good, misses counted with 30 s, on {loop['lanes']} vehicles for each fault in the "
        f"conditions of the suite `standard`, and the budget of speed offsets {loop['budget']:g} "
        "m/s. Energy and speed are those that the same vehicles have more than in cruise without "
        "their faults, and the last column is the share of their samples at which a fault is more "
        "probable than `normal`; no threshold is set."
    )
    columns = [
        "stimulus",
        "isolation [s]",
        "less that without shift",
        *faults,
        "energy",
        "speed, rms [m/s]",
    ]
    columns += ["suspected if healthy"]
    return table_section("In the closed loop", columns, rows, text)


def _triple(triple: Sequence[float], sign: str = "") -> str:
    return with_interval(triple[0], triple[1:], 2, sign)
