"""The page of ``python -m training.studies.isolability``, made from its results alone."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auv_fault_env.parameters import SAMPLE_TIME
from training.bounds.active_ceiling import WINDOW
from training.bounds.structural_isolability import MISSING
from training.report.cells import number, significant
from training.report.sections import figure, figure_section, table_section

Results = Mapping[str, Any]
Matrix = Sequence[Sequence[float]]
# nat/s; at a lower rate the contribution of a sensor is within its scatter
LEAST_RATE = 0.2
# a rival is excluded when it is less likely by this factor
CERTAINTY = 100.0
# nat/s, largest rounding error of a rate of zero
ROUNDING = 1e-6
STIMULUS = "thesis"


def page(results: Results) -> dict[str, Any]:
    """Title, introduction and sections."""
    sections = (_maps, _rivals, _band, _removal, _ceiling, _cramer_rao, _structure)
    return {
        "title": "Which faults can be isolated",
        "summary": _summary(results),
        "intro": _intro(results),
        "sections": [section(results) for section in sections],
    }


def _summary(results: Results) -> list[str]:
    """Which classes are separated soonest and latest, and how much a stimulus can help."""
    names = results["classes"]
    rates = results["rates"][STIMULUS]
    rivals = {name: least_rival(rates, k) for k, name in enumerate(names)}
    slowest = min(rivals, key=lambda name: rivals[name][1])
    fastest = max(rivals, key=lambda name: rivals[name][1])
    known = {k: one for k, one in results["ceiling"].items() if one["speed_up"] is not None}
    sentences = [
        f"Evidence between {len(names)} classes was measured on {results['vehicles']} vehicles "
        "each, at constant speeds and under the thesis' speed changes.",
        f"Under these, {fastest} is isolated soonest, {_seconds(rivals[fastest][1])} after the "
        f"transient; {slowest} latest, against {names[rivals[slowest][0]]}: "
        f"{_seconds(rivals[slowest][1])}.",
    ]
    if known:
        best = max(known, key=lambda name: known[name]["speed_up"])
        sentences.append(
            f"A stimulus helps {best} most: {known[best]['speed_up']:.1f} times the rate in cruise."
        )
    return sentences


def _seconds(rate: float) -> str:
    """Time to isolate a class at a rate [nat/s], in words."""
    if rate < LEAST_RATE / 10:
        return "hardly ever"
    return f"in about {max(np.log(CERTAINTY) / rate, SAMPLE_TIME):.1f} s"


def _intro(results: Results) -> list[str]:
    rates = (
        "Rates at which the evidence of the readings grows: natural logarithms of the likelihood "
        f"ratio per second, from {results['vehicles']} vehicles for each class and condition, with "
        f"abrupt faults of severity {results['severity']:g}, default noise and disturbance. The "
        "likelihoods are those of the Gaussian bank, which knows the onset and, unless stated "
        "otherwise, the healthy vehicle, but not the severity. A rate is that of the last 15 s of "
        "30 s, after the transient of the onset."
    )
    time = (
        f"A rate r isolates a class from another, with odds of {CERTAINTY:g} to 1, in about "
        f"{np.log(CERTAINTY):.1f}/r seconds."
    )
    return [rates, time]


def _maps(results: Results) -> dict[str, Any]:
    band = {f"{STIMULUS}, vehicle unknown within the band": results["band_rates"][STIMULUS]}
    data = {"classes": results["classes"], "rates": results["rates"] | band}
    caption = (
        "Evidence for the class of the row against that of the column, at constant speeds and on "
        "the thesis' stimulus. Dark: alike. At constant speed only the motor readings distinguish "
        "drag from thrust, because the propeller also loads the motor; speed and shaft speed do "
        "not (see the Cramér-Rao bound in cruise below)."
    )
    return figure_section("Isolability", "isolability_maps", "isolability", caption, data)


def _rivals(results: Results) -> dict[str, Any]:
    names = results["classes"]
    rows = [
        [name, *(_rival_cell(rates, k, names) for rates in results["rates"].values())]
        for k, name in enumerate(names)
    ]
    text = "The class against which evidence grows slowest, and that rate [nat/s]."
    return table_section("The most dangerous rival", ["class", *results["rates"]], rows, text)


def _rival_cell(rates: Matrix, k: int, names: Sequence[str]) -> str:
    rival, rate = least_rival(rates, k)
    return f"{names[rival]} {significant(max(rate, 0.0))}"


def least_rival(rates: Matrix, k: int, excluded: int | None = None) -> tuple[int, float]:
    """Index of the class against which evidence for class k (row) grows slowest, and the rate."""
    row = np.array(rates[k], float)
    row[[k] if excluded is None else [k, excluded]] = np.inf
    return int(row.argmin()), float(row.min())


def _band(results: Results) -> dict[str, Any]:
    names = results["classes"]
    both_rates = (results["rates"][STIMULUS], results["band_rates"][STIMULUS])
    rows = []
    for k in range(1, len(names)):
        against_normal = [significant(rates[k][0]) for rates in both_rates]
        rivals = [_rival_cell(rates, k, names) for rates in both_rates]
        rows.append([names[k], *against_normal, *rivals])
    text = (
        "Rates [nat/s] on the thesis' stimulus when the healthy vehicle is known, and when only "
        "the healthy band is known. The longer the observation, the smaller the difference: the "
        "bank estimates what is constant."
    )
    columns = [
        "class",
        "against normal",
        "band only",
        "most dangerous rival",
        "band only",
    ]
    return table_section("What not knowing the vehicle costs", columns, rows, text)


def _removal(results: Results) -> dict[str, Any]:
    names = results["classes"]
    rates = results["rates"][STIMULUS]
    without = results["without"]
    shares = [
        [_share_left(rates, without[channel], names, name, channel) for channel in without]
        for name in names[1:]
    ]
    caption = (
        "Percentage of the evidence against the most dangerous rival, on the thesis' stimulus, "
        "that remains without a sensor. Empty where the fault is that of the sensor itself, and "
        "where there is hardly any evidence with the sensor. The class of the missing sensor does "
        "not count as a rival."
    )
    data = {"classes": names[1:], "channels": list(without), "shares": shares}
    heading = "What each sensor adds"
    return figure_section(heading, "sensor_removal", "sensor-removal", caption, data)


def _share_left(
    rates: Matrix, without: Matrix, names: Sequence[str], name: str, channel: str
) -> float | None:
    """Share of the evidence for a class that remains without a sensor; None where meaningless."""
    k = names.index(name)
    missing = names.index(f"sensor:{channel}")
    _, before = least_rival(rates, k, missing)
    _, after = least_rival(without, k, missing)
    if k == missing or before < LEAST_RATE:
        return None
    return round(float(np.clip(after / before, 0.0, 1.0)), 3)


def _ceiling(results: Results) -> dict[str, Any]:
    rows = [
        [
            fault,
            f"{significant(ceiling['passive'])} ({ceiling['passive_rival']})",
            significant(ceiling["active"]),
            number(ceiling["speed_up"], 1, "no rate to compare with"),
            _profile_cell(**ceiling["profile"]),
        ]
        for fault, ceiling in results["ceiling"].items()
    ]
    text = (
        "The rate against the most dangerous rival in cruise at 1 ft/s, and the largest rate found "
        "over periodic speed profiles with a root mean square of 0.25 ft/s about it. Their ratio "
        "is the largest speed-up of isolation found; more may be possible, as the search is short "
        "and tries no other profiles. Profiles: period, share of the period above the mission "
        "speed, and roundness from square (0) to sine (1)."
    )
    columns = [
        "fault",
        "cruise [nat/s] (rival)",
        "best [nat/s]",
        "speed-up",
        "best profile",
    ]
    return table_section("How much a stimulus can help", columns, rows, text)


def _profile_cell(cycles: int, duty: float, roundness: float) -> str:
    return f"{WINDOW / cycles:.1f} s, {duty:.0%}, {roundness:.1f}"


def _cramer_rao(results: Results) -> dict[str, Any]:
    lines = results["cramer_rao"]["errors"]
    severity = results["cramer_rao"]["severity"]
    time = np.round(0.1 * np.arange(len(lines["bound"]["alpha"])), 1).tolist()
    caption = (
        "Root mean square errors of drag (alpha) and thrust (beta) coefficients on the thesis' "
        "stimulus beside the posterior Cramér-Rao bound for paddle wheel and shaft speeds; the "
        "parameter filter also uses the accelerometer. In cruise, at constant speed, only their "
        "ratio can be estimated."
    )
    text = (
        "The table shows the least standard deviation of the severity of a fault after a minute, "
        "on a vehicle that is known otherwise, from paddle wheel and shaft speeds alone; motor "
        "readings say more about a propeller."
    )
    rows = [
        [fault, *(f"{of_mission[fault]:.2f}" for of_mission in severity.values())]
        for fault in severity[STIMULUS]
    ]
    heading = "How accurately drag and thrust can be estimated"
    plot = figure("cramer_rao", "cramer-rao", caption, {"time": time, "lines": lines})
    return table_section(heading, ["fault", *severity], rows, text) | {"figures": [plot]}


def _structure(results: Results) -> dict[str, Any]:
    heading = "Structure and information"
    structure = results["structure"]
    if structure is None:
        return {"heading": heading, "text": [MISSING]}
    faults = structure["faults"]
    isolable = np.array(structure["isolable"])
    rates = np.array(structure["rates"])
    has_information = rates > ROUNDING
    words = np.where(isolable, "yes", "no")
    rows = []
    for k, fault in enumerate(faults):
        shown = np.where(has_information[k], rates[k], 0.0)
        rows.append([fault, *map("{}, {:.3g}".format, words[k], shown)])
    text = (
        "Can a fault of the port shaft (row) be isolated from another (column) that may be any "
        "signal? The answer by structure, from the Fault Diagnosis Toolbox, and the rate [nat/s] "
        "of evidence in steady motion at 1 ft/s, from the linearised equations. They agree on "
        f"{(isolable == has_information).sum()} of {len(faults) ** 2} pairs. The classes above use "
        "more knowledge: a changed parameter is constant, and a propeller also drives the vehicle."
    )
    return table_section(heading, ["fault", *faults], rows, text)
