"""The page of ``python -m training.studies.isolability``: what can be told apart, made from its results alone."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from training.bounds.active_ceiling import WINDOW
from training.bounds.structural_isolability import MISSING

Results = Mapping[str, Any]
ALIKE = 0.2  # nat/s: at less evidence, what a sensor adds is lost in its scatter
CERTAINTY = 100.0  # a rival is ruled out when it is so many times less likely
NOUGHT = 1e-6  # nat/s, what rounding leaves of nothing
STIMULUS = "thesis"


def page(results: Results) -> dict[str, Any]:
    """Title, introduction and sections."""
    return {
        "title": "What can be told apart",
        "intro": _intro(results),
        "sections": [
            _maps(results),
            _rivals(results),
            _band(results),
            _removal(results),
            _ceiling(results),
            _cramer_rao(results),
            _structure(results),
        ],
    }


def _intro(results: Results) -> list[str]:
    return [
        "Rates at which the readings' evidence gathers, in natural logarithms of the likelihood ratio per second, from "
        f"{results['vehicles']} vehicles for each class and condition: abrupt faults of severity "
        f"{results['severity']:g}, default noise and disturbance. The likelihoods are the filter bank's, told when the "
        "fault began and, where nothing else is said, the healthy vehicle, but no severity. The rate is that of the "
        "last 15 s of 30 s, when the shock of the onset is over.",
        f"A rate r tells two classes apart, at {CERTAINTY:g} to 1, in about {np.log(CERTAINTY):.1f}/r seconds.",
    ]


def _maps(results: Results) -> dict[str, Any]:
    band = {f"{STIMULUS}, vehicle unknown within the band": results["band_rates"][STIMULUS]}
    data = {"classes": results["classes"], "rates": results["rates"] | band}
    caption = (
        "Evidence for the class of the row against that of the column, at constant speeds and on the thesis' stimulus. "
        "Dark: alike. At constant speed only the motors, which feel the propeller too, tell drag from thrust; speed "
        "and shaft speed alone do not (see the Cramér-Rao bound in cruise below)."
    )
    return {
        "heading": "Isolability",
        "text": [],
        "figures": [
            {"plot": "isolability_maps", "name": "isolability", "caption": caption, "data": data}
        ],
    }


def _rivals(results: Results) -> dict[str, Any]:
    names = results["classes"]
    rows = [
        [name, *(_rival(matrix, k, names) for matrix in results["rates"].values())]
        for k, name in enumerate(names)
    ]
    return {
        "heading": "The most dangerous rival",
        "text": ["The class against which evidence gathers slowest, and that rate [nat/s]."],
        "table": {"columns": ["class", *results["rates"]], "rows": rows},
    }


def _rival(matrix: Any, k: int, names: list[str]) -> str:
    rival, rate = least_rival(matrix, k)
    return f"{names[rival]} {max(rate, 0.0):.2g}"


def least_rival(matrix: Any, k: int, but: int | None = None) -> tuple[int, float]:
    """The class, `but` left out, against which evidence for class k (row) gathers slowest, and the rate."""
    row = np.array(matrix[k], float)
    row[[k] if but is None else [k, but]] = np.inf
    return int(row.argmin()), float(row.min())


def _band(results: Results) -> dict[str, Any]:
    names = results["classes"]
    rows = []
    for k, name in enumerate(names[1:], start=1):
        known, band = (results[key][STIMULUS] for key in ("rates", "band_rates"))
        rows.append(
            [
                name,
                f"{known[k][0]:.2g}",
                f"{band[k][0]:.2g}",
                _rival(known, k, names),
                _rival(band, k, names),
            ]
        )
    return {
        "heading": "What not knowing the vehicle costs",
        "text": [
            "Rates [nat/s] on the thesis' stimulus when the healthy vehicle is known, and when only the band is known "
            "in which healthy vehicles lie. The longer it lasts, the less it costs: what is constant is learnt."
        ],
        "table": {
            "columns": [
                "class",
                "against normal",
                "band only",
                "most dangerous rival",
                "band only",
            ],
            "rows": rows,
        },
    }


def _removal(results: Results) -> dict[str, Any]:
    names = results["classes"]
    whole = results["rates"][STIMULUS]
    without = results["without"]
    shares = [
        [_left(whole, without[channel], names, name, channel) for channel in without]
        for name in names[1:]
    ]
    caption = (
        "Per cent of the evidence against the most dangerous rival, on the thesis' stimulus, that is left when a "
        "sensor is missing; empty where the fault is that sensor's own, and where there is hardly any evidence anyway. "
        "Rivals are all classes but the missing sensor's."
    )
    data = {"classes": names[1:], "channels": list(without), "shares": shares}
    return {
        "heading": "What every sensor adds",
        "text": [],
        "figures": [
            {"plot": "sensor_removal", "name": "sensor-removal", "caption": caption, "data": data}
        ],
    }


def _left(whole: Any, without: Any, names: list[str], name: str, channel: str) -> float | None:
    k = names.index(name)
    missing = names.index(f"sensor:{channel}")
    before, after = (least_rival(matrix, k, missing)[1] for matrix in (whole, without))
    return (
        None
        if k == missing or before < ALIKE
        else round(float(np.clip(after / before, 0.0, 1.0)), 3)
    )


def _ceiling(results: Results) -> dict[str, Any]:
    rows = [
        [
            fault,
            f"{one['passive']:.2g} ({one['passive_rival']})",
            f"{one['active']:.2g}",
            "no rate to compare with" if one["speed_up"] is None else f"{one['speed_up']:.1f}",
            _profile(**one["profile"]),
        ]
        for fault, one in results["ceiling"].items()
    ]
    return {
        "heading": "How much a stimulus can help",
        "text": [
            "The rate against the most dangerous rival in cruise at 1 ft/s, and the largest one found over periodic "
            "speed profiles with a root mean square of 0.25 ft/s about it. Their ratio is the largest speed-up of "
            "isolation that was found; more may be possible, as the search is short and tries no other profiles. "
            "Profiles: period, share of the period above the mission speed, and roundness from square (0) to sine (1)."
        ],
        "table": {
            "columns": [
                "fault",
                "cruise [nat/s] (rival)",
                "best [nat/s]",
                "speed-up",
                "best profile",
            ],
            "rows": rows,
        },
    }


def _profile(cycles: int, duty: float, roundness: float) -> str:
    return f"{WINDOW / cycles:.1f} s, {duty:.0%}, {roundness:.1f}"


def _cramer_rao(results: Results) -> dict[str, Any]:
    lines = results["cramer_rao"]["errors"]
    severities = results["cramer_rao"]["severity"]
    time = np.round(0.1 * np.arange(len(lines["bound"]["alpha"])), 1).tolist()
    caption = (
        "Root mean square errors of drag (alpha) and thrust (beta) coefficients on the thesis' stimulus beside the "
        "posterior Cramér-Rao bound for paddle wheel and shaft speeds; the parameter filter also reads the "
        "accelerometer. In cruise, at constant speed, neither can be known, only their ratio."
    )
    return {
        "heading": "How well drag and thrust can be known",
        "text": [
            "The table holds the least standard deviation of a fault's severity after a minute, on a vehicle otherwise "
            "known, if nothing but paddle wheel and shaft speeds is read; motor readings tell more of a propeller."
        ],
        "table": {
            "columns": ["fault", *severities],
            "rows": [
                [fault, *(f"{by[fault]:.2f}" for by in severities.values())]
                for fault in severities[STIMULUS]
            ],
        },
        "figures": [
            {
                "plot": "cramer_rao",
                "name": "cramer-rao",
                "caption": caption,
                "data": {"time": time, "lines": lines},
            }
        ],
    }


def _structure(results: Results) -> dict[str, Any]:
    structure = results["structure"]
    if structure is None:
        return {"heading": "Structure and numbers", "text": [MISSING]}
    faults = structure["faults"]
    rows = [
        [fault, *(_verdict(*cell) for cell in zip(apart, rates, strict=True))]
        for fault, apart, rates in zip(
            faults, structure["isolable"], structure["rates"], strict=True
        )
    ]
    pairs = np.array(structure["isolable"]), np.array(structure["rates"]) > NOUGHT
    agree = int((pairs[0] == pairs[1]).sum())
    return {
        "heading": "Structure and numbers",
        "text": [
            "Can a fault of the port shaft (row) be told from another (column) if that one may be any signal? By "
            "structure, as the Fault Diagnosis Toolbox finds it, and the rate [nat/s] at which evidence gathers in "
            f"steady motion at 1 ft/s, by the linearised equations. They agree on {agree} of {len(faults) ** 2} pairs. "
            "The classes above know more: a changed parameter stays changed, and a propeller also pushes the vehicle."
        ],
        "table": {"columns": ["fault", *faults], "rows": rows},
    }


def _verdict(apart: bool, rate: float) -> str:
    return (
        f"{'yes' if apart else 'no'}, {rate:.3g}"
        if rate > NOUGHT
        else f"{'yes' if apart else 'no'}, 0"
    )
