"""Section V.C of the report, the network on unprocessed data: rows thesis | ours, its tables and its figures."""

from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import labels
from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.networks.fault_map import MODES_5_1
from training.thesis.backpropagation import MOMENTUM, RATE, SPREAD
from training.thesis.comparison import Comparison, share, spread
from training.thesis.raw_networks import (
    CHECKPOINTS,
    DRAGS,
    FULL_SCALE,
    POINTS,
    PROPELLERS,
    SIZES,
    THRUST_ALONE,
    RawStudy,
    drag_settled,
    errors,
    first_drag_points_named,
    friction_told_from_normal,
    named_correctly,
)

FIGURES = ("5.7", "5.8", "5.9", "5.10")
EVERY = 4  # points of a figure: one in four
BEST = 2  # 90,000 presentations, in CHECKPOINTS
ENOUGH = 6  # hidden nodes, thesis V.C.1


def sections(view: Comparison, study: RawStudy, columns: list[str]) -> list[dict[str, Any]]:
    """All of V.C that concerns the network."""
    return [
        recall_section(view, study, columns),
        table_5_1(view, study),
        sizes_section(view, study, columns),
        confusion_section(view, study, columns),
        settings_section(view, study),
    ]


def accuracy(outputs: np.ndarray) -> np.ndarray:
    """Share of all points named correctly, (n_checkpoints, n_networks)."""
    return named_correctly(outputs).mean(axis=-1)


def recall_section(view: Comparison, study: RawStudy, columns: list[str]) -> dict[str, Any]:
    """Figures 5.7 to 5.10."""
    n_networks = study.noisy.shape[1]
    scales = ", ".join(f"{scale:g} {CHANNELS[name].unit}" for name, scale in FULL_SCALE.items())
    rows = [
        data_row(view),
        apart_row(view, study),
        *first_points_rows(view, study),
        settled_row(view, study),
    ]
    rows += [least_error_row(view, study), response_row(view, study), steady_row(view, study)]
    return {
        "heading": "V.C: the network on unprocessed data",
        "text": [
            f"Four inputs (port motor voltage, current, shaft speed; surge speed), six hidden nodes, four outputs; "
            f"{n_networks} networks, mean ± standard deviation over them, each with initial weights and a random "
            "order of presentations of its own. The training set is that of Figs 5.3 to 5.6 above, one sample per "
            "presentation, recalled after training as in the thesis: these figures show learning, not "
            "generalisation. With default noise every network trains on, and recalls, readings with noise of their "
            "own. A point is named after the largest output.",
            f"Readings are divided by fixed scales, {scales}. Learning rate {RATE}, momentum {MOMENTUM} and initial "
            f"weights within ± {SPREAD} are ours: none is in the thesis (see the study of them below).",
        ],
        "table": {"columns": columns, "rows": rows},
        "figures": [
            recall_figure(
                study.size[ENOUGH],
                "fig-5-7-to-5-10",
                "Figs 5.7 to 5.10: recall of the training set after 24,000 to 150,000 presentations, noise-free.",
            ),
            recall_figure(
                study.variant[THRUST_ALONE],
                "fig-5-7-to-5-10-thrust-alone",
                "The same with drag +35 % and a propeller fault that takes 35 % of the thrust and none of the torque: "
                "now drag begins as degraded propeller, as in the thesis, and so does normal operation.",
            ),
        ],
    }


def data_row(view: Comparison) -> list[str]:
    """The size of the training set."""
    seconds = (len(view.clean.mean) - 1) / SAMPLE_RATE
    why = "Of each run the first 400 points, as in the thesis' figures."
    ours = f"{SAMPLE_RATE:g} Hz, {seconds:g} s, 4 × {POINTS} points"
    return view.row(
        "V.C", "training sets", "10 Hz, about 60 s, 4 × 400 points", ours, ours, True, why
    )


def apart_row(view: Comparison, study: RawStudy) -> list[str]:
    """Figure 5.7: normal and friction."""
    clean, noisy = (
        friction_told_from_normal(outputs)[0] for outputs in (study.size[ENOUGH], study.noisy)
    )
    quantity = "normal and seal friction told apart after 24,000: right one of their outputs larger"
    why = "Friction needs more current at any speed, from the first turn of the shaft."
    met = bool(clean.mean() > 0.95)
    return view.row(
        "V.C, Fig. 5.7", quantity, "well distinguished", share(clean), share(noisy), met, why
    )


def first_points_rows(view: Comparison, study: RawStudy) -> list[list[str]]:
    """Figures 5.7 to 5.10: what the first points of the drag fault are called."""
    outputs = study.size[ENOUGH]
    rows = []
    clean, noisy = (
        first_drag_points_named(o, "degraded propeller") for o in (outputs, study.noisy)
    )
    normal = first_drag_points_named(outputs, "normal")
    for k, (figure, count) in enumerate(zip(FIGURES, CHECKPOINTS, strict=True)):
        quantity = f"of drag's first 100 points, named degraded propeller after {count:,}"
        why = f"Ours: {spread(normal[k])} named normal, the others drag. See 'drag and propeller' below."
        met = bool(clean[k].mean() > 50)
        rows.append(
            view.row(
                f"V.C, Fig. {figure}", quantity, "all", spread(clean[k]), spread(noisy[k]), met, why
            )
        )
    return rows


def settled_row(view: Comparison, study: RawStudy) -> list[str]:
    """When drag is named for good."""
    clean, noisy = (drag_settled(o)[BEST] for o in (study.size[ENOUGH], study.noisy))
    quantity = f"points until drag's output stays the largest, after {CHECKPOINTS[BEST]:,}"
    why = (
        f"Between 50 and 150 in {in_time(clean).sum()} of {len(clean)} networks. For 13 s normal and drag run through "
        "nearly the same readings, and a network names both normal or both drag, by chance of its seed. With noise "
        "single late points still flip."
    )
    met = bool(in_time(clean).mean() > 0.5)
    return view.row("V.C, Figs 5.7-5.10", quantity, "100", spread(clean), spread(noisy), met, why)


def in_time(points: np.ndarray) -> np.ndarray:
    """Whether a network settles on drag after about the thesis' 100 points."""
    return (points > 50) & (points < 150)


def least_error_row(view: Comparison, study: RawStudy) -> list[str]:
    """The rms error over training."""
    clean, noisy = (errors(outputs) for outputs in (study.size[ENOUGH], study.noisy))
    text = [
        " / ".join(f"{mean:.3f}" for mean in e.mean(axis=1)) + f" (± {e[-1].std(ddof=1):.3f})"
        for e in (clean, noisy)
    ]
    first = int((clean.argmin(axis=0) == len(CHECKPOINTS) - 1).sum())
    why = f"Noise-free least at 150,000 in {first} of {clean.shape[1]} networks."
    quantity = "rms output error after 24,000 / 60,000 / 90,000 / 150,000"
    met = bool(clean.mean(axis=1).argmin() == 3)
    return view.row("V.C, Fig. 5.10", quantity, "least at 150,000", *text, met, why)


def response_row(view: Comparison, study: RawStudy) -> list[str]:
    """Whether less training responds better."""
    clean, noisy = (accuracy(outputs) for outputs in (study.size[ENOUGH], study.noisy))
    text = [
        " / ".join(f"{100 * m:.1f}" for m in a.mean(axis=1))
        + f" % (± {100 * a[-1].std(ddof=1):.1f})"
        for a in (clean, noisy)
    ]
    gain = 100 * (clean[1:3] - clean[-1])
    best = gain[gain.mean(axis=1).argmax()]
    error = best.std(ddof=1) / np.sqrt(len(best))
    why = (
        f"Paired over networks, the better of 60,000 and 90,000 names {best.mean():+.2f} ± {error:.2f} % (standard "
        "error) more points than 150,000; only more than twice the error counts as better."
    )
    quantity = "points named correctly after 24,000 / 60,000 / 90,000 / 150,000"
    met = bool(best.mean() > 2 * error)
    return view.row(
        "V.C, Figs 5.8, 5.9", quantity, "60,000 or 90,000 better than 150,000", *text, met, why
    )


def steady_row(view: Comparison, study: RawStudy) -> list[str]:
    """VI.A: steady values suffice."""
    clean, noisy = (
        named_correctly(o, late=True)[BEST].min(axis=-1) for o in (study.size[ENOUGH], study.noisy)
    )
    quantity = (
        f"second half of each transient, worst mode: named correctly after {CHECKPOINTS[BEST]:,}"
    )
    why = "Once the transient has settled, all four modes are told apart by their steady values."
    met = bool(clean.mean() > 0.9)
    return view.row("VI.A", quantity, "steady values suffice", share(clean), share(noisy), met, why)


def recall_figure(outputs: np.ndarray, name: str, caption: str) -> dict[str, Any]:
    """Mean and spread of the four outputs over the training set, (n_checkpoints, n_networks, n_points, n_modes)."""
    thinned = outputs[:, :, ::EVERY]
    mean = thinned.mean(axis=1)
    std = thinned.std(axis=1, ddof=1)
    lines = lambda values: np.round(values.swapaxes(1, 2).astype(float), 3).tolist()  # noqa: E731
    return {
        "plot": "network_outputs",
        "name": name,
        "caption": f"{caption} Mean ± standard deviation over {outputs.shape[1]} networks.",
        "data": {
            "point": list(range(0, len(MODES_5_1) * POINTS, EVERY)),
            "modes": list(MODES_5_1),
            "presentations": list(CHECKPOINTS),
            "mean": lines(mean),
            "std": lines(std),
        },
    }


def table_5_1(view: Comparison, study: RawStudy) -> dict[str, Any]:
    """Table 5.1 beside our classes, with the recall of each mode."""
    clean, noisy = (named_correctly(outputs)[BEST] for outputs in (study.size[ENOUGH], study.noisy))
    late = named_correctly(study.size[ENOUGH], late=True)[BEST]
    rows = []
    for k, mode in enumerate(MODES_5_1):
        vector = "(" + ",".join("1" if k == j else "0" for j in range(len(MODES_5_1))) + ")"
        classes = ", ".join(name for name, modes in labels().items() if modes[0] == mode)
        rows.append(
            [
                mode,
                f"y{k + 1}={vector}",
                classes,
                *(share(part[:, k]) for part in (clean, late, noisy)),
                view.command,
            ]
        )
    columns = [
        "operating mode",
        "fault vector",
        "our classes",
        "named correctly, noise-free",
        "of it, second half",
    ]
    return {
        "heading": "Table 5.1: operating modes of the raw-data network",
        "text": [
            f"Share of each mode's 400 points that are named after it, after {CHECKPOINTS[BEST]:,} presentations. The "
            "thesis has no such figures. What is lost of normal and drag lies in the first half, where they share "
            "their readings."
        ],
        "table": {"columns": [*columns, "named correctly, default noise", "command"], "rows": rows},
    }


def separated(outputs: np.ndarray) -> np.ndarray:
    """Whether each network, once settled, names most points of every mode correctly, (n_checkpoints, n_networks)."""
    return (named_correctly(outputs, late=True) > 0.5).all(axis=-1)


def sizes_section(view: Comparison, study: RawStudy, columns: list[str]) -> dict[str, Any]:
    """How many hidden nodes: 4-8-4, six suffice, fewer do not."""
    count = {size: int(separated(outputs)[-1].sum()) for size, outputs in study.size.items()}
    n_networks = study.noisy.shape[1]
    rows = []
    for size in SIZES:
        thesis = {True: "told apart", False: "not told apart"}[size >= ENOUGH]
        outputs = study.size[size]
        met = (count[size] > n_networks / 2) == (size >= ENOUGH)
        ours = f"{count[size]} of {n_networks} networks; rms {spread(errors(outputs)[-1], '.3f')}"
        early = int(separated(outputs)[0].sum())
        why = f"Named correctly {share(accuracy(outputs)[-1])}; after 24,000: {early} of {n_networks}."
        rows.append(
            view.row("V.C.1", f"4-{size}-4: four modes after 150,000", thesis, ours, "-", met, why)
        )
    fewest = min((size for size in SIZES if count[size] > n_networks / 2), default=None)
    return {
        "heading": "V.C: how many hidden nodes?",
        "text": [
            "A network tells the four modes apart if, in the second half of every transient, most points are named "
            "correctly. The thesis began with 4-8-4, found six nodes to suffice and fewer to fail. Networks of one "
            "seed see the same presentations, whatever their size.",
            f"Ours: six do as well as eight, as in the thesis; but the fewest that suffice are {fewest}. Each hidden "
            "node draws one plane through the readings, and the four modes lie on few curves, so few planes can part "
            "them. Fewer nodes learn more slowly: see the counts after 24,000. The thesis may have stopped earlier, or "
            "had a poor start: it seems to tell of one network of each size.",
        ],
        "table": {"columns": columns, "rows": rows},
    }


def confusion_section(view: Comparison, study: RawStudy, columns: list[str]) -> dict[str, Any]:
    """Which sizes of the faults make drag look like a degraded propeller."""
    return {
        "heading": "V.C: drag and propeller, what the confusion hangs on",
        "text": [
            "The thesis does not say how large its faults were. With ours hardly a point of drag is named degraded "
            "propeller, because a damaged propeller also takes less torque: the current tells it from the first turn "
            "of the shaft. If the propeller loses thrust alone, as where the thesis lowers beta (IV.C, V.D), the motor "
            "reads the same at the same speeds; then normal, drag and propeller run along nearly one curve until each "
            "stops at its own steady speed. A network names the common part after the mode that stays there longest, "
            "the weaker propeller, and drag begins as degraded propeller, as in the thesis: its finding is, in kind, "
            "that of a propeller that loses thrust alone. How long it lasts depends on the sizes of both. Normal "
            "operation shares that part and is then misnamed as well, which the thesis does not report.",
        ],
        "table": {"columns": columns, "rows": thrust_alone_rows(view, study)},
        "figures": [confusion_figure(study)],
    }


def thrust_alone_rows(view: Comparison, study: RawStudy) -> list[list[str]]:
    """The thesis' two claims with a propeller that loses thrust alone."""
    outputs = study.variant[THRUST_ALONE]
    named = first_drag_points_named(outputs, "degraded propeller")
    settled = drag_settled(outputs)[BEST]
    case = "beta -35 %, torque as before, drag +35 %:"
    where = "V.C, Figs 5.7-5.10"
    by_training = " / ".join(map(spread, named)) + " after 24,000 / 60,000 / 90,000 / 150,000."
    normal = share(named_correctly(outputs)[BEST][:, 0])
    why = f"Between 50 and 150 in {in_time(settled).sum()} of {len(settled)} networks. "
    why += f"Of the normal run {normal} is named correctly."
    first = f"{case} of the first 100 points, named degraded propeller after {CHECKPOINTS[BEST]:,}"
    second = f"{case} points until drag's output stays the largest, after {CHECKPOINTS[BEST]:,}"
    confused = bool(named[BEST].mean() > 50)
    in_order = bool(in_time(settled).mean() > 0.5)
    return [
        view.row(where, first, "all", spread(named[BEST]), "-", confused, by_training),
        view.row(where, second, "100", spread(settled), "-", in_order, why),
    ]


def confusion_figure(study: RawStudy) -> dict[str, Any]:
    """The confusion by the sizes of both faults."""
    named = {
        case: first_drag_points_named(outputs, "degraded propeller")[BEST]
        for case, outputs in study.variant.items()
    }
    settled = {case: drag_settled(outputs)[BEST] for case, outputs in study.variant.items()}
    table = lambda entry: [[entry(drag, propeller) for propeller in PROPELLERS] for drag in DRAGS]  # noqa: E731
    return {
        "plot": "confusion_by_size",
        "name": "drag-and-propeller",
        "caption": "Of drag's first 100 points, those named degraded propeller, by the sizes of both faults; below "
        "them the point from which drag's output stays the largest (the thesis: all, and 100). Noise-free, after "
        f"{CHECKPOINTS[BEST]:,} presentations, mean ± standard deviation over networks.",
        "data": {
            "drags": [f"+{100 * drag:.0f} %" for drag in DRAGS],
            "propellers": list(PROPELLERS),
            "count": table(lambda *case: round(float(named[case].mean()), 1)),
            "text": table(lambda *case: f"{spread(named[case])}\nfrom {spread(settled[case])}"),
        },
    }


def settings_section(view: Comparison, study: RawStudy) -> dict[str, Any]:
    """The study behind learning rate and momentum."""
    rows = [
        [
            f"{rate:g}",
            f"{momentum:g}",
            *(spread(part, ".3f") for part in errors(outputs)),
            view.command,
        ]
        for (rate, momentum), outputs in study.setting.items()
    ]
    return {
        "heading": "V.C: learning rate and momentum",
        "text": [
            "Training rms of 4-6-4 networks, noise-free, by setting and presentations; nothing else was looked at. "
            f"{RATE} and {MOMENTUM} lie in the flat middle; with momentum 0.9 training is unstable from 0.3 on."
        ],
        "table": {
            "columns": [
                "learning rate",
                "momentum",
                *(f"rms after {count:,}" for count in CHECKPOINTS),
                "command",
            ],
            "rows": rows,
        },
    }
