"""Sections of the report on V.C, the network on raw data: rows thesis | ours, and figures."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import labels
from auv_fault_env.parameters import SAMPLE_RATE
from diagnosers.networks.fault_map import MODES_5_1
from training.report.sections import figure, table_section
from training.thesis.backpropagation import INITIAL_RANGE, LEARNING_RATE, MOMENTUM
from training.thesis.comparison import (
    COLUMNS,
    Comparison,
    mean_and_std,
    mean_and_std_percent,
)
from training.thesis.raw_networks import (
    CHECKPOINTS,
    DRAG_SEVERITIES,
    ENOUGH,
    FULL_SCALE,
    POINTS,
    PROPELLER_FAULTS,
    SIZES,
    THRUST_ALONE,
    RawStudy,
    accuracy_by_mode,
    first_drag_points_named,
    friction_accuracy,
    points_until_drag,
    rms_errors,
)

FIGURES = ("5.7", "5.8", "5.9", "5.10")
EVERY = 4  # one in so many points is in a figure
BEST = 2  # 90,000 presentations, in CHECKPOINTS
AFTER = "after 24,000 / 60,000 / 90,000 / 150,000"


def sections(comparison: Comparison, study: RawStudy) -> list[dict[str, Any]]:
    """All sections of V.C that concern the network."""
    return [
        output_section(comparison, study),
        table_5_1(study),
        sizes_section(comparison, study),
        confusion_section(comparison, study),
        settings_section(study),
    ]


def accuracy(outputs: np.ndarray) -> np.ndarray:
    """Share of all points named correctly, (n_checkpoints, n_networks)."""
    return accuracy_by_mode(outputs).mean(axis=-1)


def output_section(comparison: Comparison, study: RawStudy) -> dict[str, Any]:
    """Figures 5.7 to 5.10."""
    n_networks = study.noisy.shape[1]
    scales = ", ".join(f"{scale:g} {CHANNELS[name].unit}" for name, scale in FULL_SCALE.items())
    rows = [
        *data_rows(comparison, study),
        *first_points_rows(comparison, study),
        settled_row(comparison, study),
        least_error_row(comparison, study),
        response_row(comparison, study),
        steady_row(comparison, study),
    ]
    clean_caption = (
        "Thesis Figs 5.7 to 5.10: outputs for the training set after 24,000 to 150,000 "
        "presentations, noise-free."
    )
    thrust_caption = (
        "The same with drag +35 % and a propeller fault that takes 35 % of the thrust and none of "
        "the torque: now drag begins as degraded propeller, as in the thesis, and so does normal "
        "operation."
    )
    name = "fig-5-7-to-5-10"
    figures = [
        output_figure(study.by_size[ENOUGH], name, clean_caption),
        output_figure(study.by_variant[THRUST_ALONE], f"{name}-thrust-alone", thrust_caption),
    ]
    what = (
        "Four inputs (port motor voltage, current, shaft speed; surge speed), six hidden "
        f"nodes, four outputs; {n_networks} networks, mean ± standard deviation over them, "
        "each with its own initial weights and its own random order of presentations. The "
        "training set is that of Figs 5.3 to 5.6 above, one sample per presentation. As in the "
        "thesis, the outputs are those for the training set itself: these figures show "
        "learning, not generalisation. With default noise every network is trained and "
        "evaluated on readings with noise of their own. A point is named after the largest "
        "output."
    )
    settings = (
        f"Readings are divided by fixed scales, {scales}. Learning rate {LEARNING_RATE}, "
        f"momentum {MOMENTUM} and initial weights within ± {INITIAL_RANGE} are ours: none is "
        "in the thesis (see the study of them below)."
    )
    section = table_section("V.C: the network on raw data", COLUMNS, rows, what, settings)
    return section | {"figures": figures}


def both_texts(values: Iterable[np.ndarray], percent: bool = False) -> list[str]:
    """Mean and standard deviation over the networks, without and with noise."""
    form = mean_and_std_percent if percent else mean_and_std
    return [form(of_networks) for of_networks in values]


def data_rows(comparison: Comparison, study: RawStudy) -> list[list[str]]:
    """The size of the training set; Figure 5.7: normal and friction."""
    seconds = (len(comparison.clean.mean) - 1) / SAMPLE_RATE
    size = f"{SAMPLE_RATE:g} Hz, {seconds:g} s, 4 × {POINTS} points"
    thesis = "10 Hz, about 60 s, 4 × 400 points"
    size_why = "Of each run the first 400 points, as in the thesis' figures."
    accuracies = [friction_accuracy(outputs)[0] for outputs in (study.by_size[ENOUGH], study.noisy)]
    texts = both_texts(accuracies, percent=True)
    agrees = accuracies[0].mean() > 0.95
    quantity = (
        "normal and seal friction distinguished after 24,000: right one of their outputs larger"
    )
    why = "Friction needs more current at any speed, from the first turn of the shaft."
    return [
        comparison.row("V.C", "training sets", thesis, size, size, True, size_why),
        comparison.row("V.C, Fig. 5.7", quantity, "well distinguished", *texts, agrees, why),
    ]


def first_points_rows(comparison: Comparison, study: RawStudy) -> list[list[str]]:
    """Figures 5.7 to 5.10: how the first points of the drag fault are named."""
    outputs = study.by_size[ENOUGH]
    clean = first_drag_points_named(outputs, "degraded propeller")
    noisy = first_drag_points_named(study.noisy, "degraded propeller")
    normal = first_drag_points_named(outputs, "normal")
    rows = []
    for k, (number, count) in enumerate(zip(FIGURES, CHECKPOINTS, strict=True)):
        where = f"V.C, Fig. {number}"
        quantity = f"of drag's first 100 points, named degraded propeller after {count:,}"
        texts = both_texts((clean[k], noisy[k]))
        why = (
            f"Ours: {mean_and_std(normal[k])} named normal, the others drag. See "
            "'when drag is confused with the propeller' below."
        )
        agrees = clean[k].mean() > 50
        rows.append(comparison.row(where, quantity, "all", *texts, agrees, why))
    return rows


def settled_row(comparison: Comparison, study: RawStudy) -> list[str]:
    """From which point on drag is named to the end."""
    clean = points_until_drag(study.by_size[ENOUGH])[BEST]
    noisy = points_until_drag(study.noisy)[BEST]
    why = (
        f"Between 50 and 150 in {is_in_time(clean).sum()} of {len(clean)} networks. For 13 s "
        "normal and drag have nearly the same readings, and a network names both normal or both "
        "drag, depending on its seed. With noise single late points still change."
    )
    quantity = f"points until drag's output stays the largest, after {CHECKPOINTS[BEST]:,}"
    texts = both_texts((clean, noisy))
    agrees = is_in_time(clean).mean() > 0.5
    return comparison.row("V.C, Figs 5.7-5.10", quantity, "100", *texts, agrees, why)


def is_in_time(points: np.ndarray) -> np.ndarray:
    """Whether a network settles on drag after about the thesis' 100 points."""
    return (points > 50) & (points < 150)


def least_error_row(comparison: Comparison, study: RawStudy) -> list[str]:
    """The rms error over the training."""
    clean = rms_errors(study.by_size[ENOUGH])
    noisy = rms_errors(study.noisy)
    texts = []
    for errors in (clean, noisy):
        means = " / ".join(f"{mean:.3f}" for mean in errors.mean(axis=1))
        texts.append(f"{means} (± {errors[-1].std(ddof=1):.3f})")
    n_least = int((clean.argmin(axis=0) == len(CHECKPOINTS) - 1).sum())
    quantity = f"rms output error {AFTER}"
    agrees = clean.mean(axis=1).argmin() == 3
    why = f"Noise-free least at 150,000 in {n_least} of {clean.shape[1]} networks."
    return comparison.row("V.C, Fig. 5.10", quantity, "least at 150,000", *texts, agrees, why)


def response_row(comparison: Comparison, study: RawStudy) -> list[str]:
    """Whether less training responds better."""
    clean = accuracy(study.by_size[ENOUGH])
    noisy = accuracy(study.noisy)
    texts = []
    for shares in (clean, noisy):
        means = " / ".join(f"{100 * mean:.1f}" for mean in shares.mean(axis=1))
        texts.append(f"{means} % (± {100 * shares[-1].std(ddof=1):.1f})")
    gain = 100 * (clean[1:3] - clean[-1])
    best = gain[gain.mean(axis=1).argmax()]
    error = best.std(ddof=1) / np.sqrt(len(best))
    why = (
        f"Paired over networks, the better of 60,000 and 90,000 names {best.mean():+.2f} ± "
        f"{error:.2f} % (standard error) more points than 150,000; only more than twice the error "
        "counts as better."
    )
    quantity = f"points named correctly {AFTER}"
    thesis = "60,000 or 90,000 better than 150,000"
    agrees = best.mean() > 2 * error
    return comparison.row("V.C, Figs 5.8, 5.9", quantity, thesis, *texts, agrees, why)


def steady_row(comparison: Comparison, study: RawStudy) -> list[str]:
    """VI.A: steady values suffice."""
    shares = []
    for outputs in (study.by_size[ENOUGH], study.noisy):
        shares.append(accuracy_by_mode(outputs, late=True)[BEST].min(axis=-1))
    texts = both_texts(shares, percent=True)
    after = f"after {CHECKPOINTS[BEST]:,}"
    quantity = f"second half of each transient, worst mode: named correctly {after}"
    agrees = shares[0].mean() > 0.9
    why = "Once the transient has settled, the steady values distinguish all four modes."
    return comparison.row("VI.A", quantity, "steady values suffice", *texts, agrees, why)


def output_figure(outputs: np.ndarray, name: str, caption: str) -> dict[str, Any]:
    """Outputs (n_checkpoints, n_networks, n_points, n_modes) over the points, mean and std."""
    thinned = outputs[:, :, ::EVERY]
    mean = thinned.mean(axis=1).swapaxes(1, 2).astype(float)
    std = thinned.std(axis=1, ddof=1).swapaxes(1, 2).astype(float)
    caption += f" Mean ± standard deviation over {outputs.shape[1]} networks."
    data = {
        "point": list(range(0, len(MODES_5_1) * POINTS, EVERY)),
        "modes": list(MODES_5_1),
        "presentations": list(CHECKPOINTS),
        "mean": np.round(mean, 3).tolist(),
        "std": np.round(std, 3).tolist(),
    }
    return figure("network_outputs", name, caption, data)


def table_5_1(study: RawStudy) -> dict[str, Any]:
    """Table 5.1 beside our classes, with the accuracy of each mode."""
    clean = accuracy_by_mode(study.by_size[ENOUGH])[BEST]
    late = accuracy_by_mode(study.by_size[ENOUGH], late=True)[BEST]
    noisy = accuracy_by_mode(study.noisy)[BEST]
    rows = []
    for k, mode in enumerate(MODES_5_1):
        vector = ",".join("1" if k == j else "0" for j in range(len(MODES_5_1)))
        classes = [name for name, modes in labels().items() if modes[0] == mode]
        shares = [mean_and_std_percent(shares[:, k]) for shares in (clean, late, noisy)]
        names = [mode, f"y{k + 1}=({vector})", ", ".join(classes)]
        rows.append([*names, *shares])
    columns = [
        "operating mode",
        "fault vector",
        "our classes",
        "named correctly, noise-free",
        "of it, second half",
        "named correctly, default noise",
    ]
    text = (
        "Share of each mode's 400 points that are named after it, after "
        f"{CHECKPOINTS[BEST]:,} presentations. The thesis has no such figures. The errors of "
        "normal and drag lie in the first half, where both have the same readings."
    )
    heading = "Table 5.1: operating modes of the raw-data network"
    return table_section(heading, columns, rows, text)


def is_separated(outputs: np.ndarray) -> np.ndarray:
    """Whether a network names most settled points of every mode, (n_checkpoints, n_networks)."""
    return (accuracy_by_mode(outputs, late=True) > 0.5).all(axis=-1)


def sizes_section(comparison: Comparison, study: RawStudy) -> dict[str, Any]:
    """How many hidden nodes: 4-8-4, six suffice, fewer do not."""
    n_networks = study.noisy.shape[1]
    sufficient = []
    for size in SIZES:
        if is_separated(study.by_size[size])[-1].sum() > n_networks / 2:
            sufficient.append(size)
    fewest = min(sufficient, default=None)
    rows = [size_row(comparison, study, size) for size in SIZES]
    thesis = (
        "A network distinguishes the four modes if, in the second half of every transient, "
        "most points are named correctly. The thesis began with 4-8-4, found six nodes to "
        "suffice and fewer to fail. Networks of one seed see the same presentations, whatever "
        "their size."
    )
    ours = (
        "Ours: six do as well as eight, as in the thesis; but the fewest that suffice are "
        f"{fewest or 'none of these'}. Each hidden node puts one plane through the readings, and "
        "the four modes lie on few curves, so few planes can separate them. Fewer nodes "
        "learn more slowly: see the counts after 24,000. The thesis may have stopped earlier, or "
        "had a poor start: it seems to report one network of each size."
    )
    return table_section("V.C: how many hidden nodes?", COLUMNS, rows, thesis, ours)


def size_row(comparison: Comparison, study: RawStudy, size: int) -> list[str]:
    """Whether networks with so many hidden nodes distinguish the four modes."""
    outputs = study.by_size[size]
    n_networks = study.noisy.shape[1]
    n_separated = int(is_separated(outputs)[-1].sum())
    n_early = int(is_separated(outputs)[0].sum())
    rms = mean_and_std(rms_errors(outputs)[-1], ".3f")
    share = mean_and_std_percent(accuracy(outputs)[-1])
    suffices = size >= ENOUGH
    quantity = f"4-{size}-4: four modes after 150,000"
    thesis = "distinguished" if suffices else "not distinguished"
    ours = f"{n_separated} of {n_networks} networks; rms {rms}"
    agrees = (n_separated > n_networks / 2) == suffices
    why = f"Named correctly {share}; after 24,000: {n_early} of {n_networks}."
    return comparison.row("V.C.1", quantity, thesis, ours, "-", agrees, why)


def confusion_section(comparison: Comparison, study: RawStudy) -> dict[str, Any]:
    """Which sizes of the faults make drag look like a degraded propeller."""
    text = (
        "The thesis does not say how large its faults were. With ours hardly a point of drag is "
        "named degraded propeller, because a damaged propeller also takes less torque: the current "
        "distinguishes it from the first turn of the shaft. If the propeller loses thrust alone, "
        "as where the thesis lowers beta (IV.C, V.D), the motor reads the same at the same speeds; "
        "then normal, drag and propeller follow nearly one curve until each stops at its own "
        "steady speed. A network names the common part after the mode that stays there longest, "
        "the weaker propeller, and drag begins as degraded propeller, as in the thesis: its "
        "finding is, in kind, that of a propeller that loses thrust alone. How long it lasts "
        "depends on the sizes of both. Normal operation shares that part and is then misnamed as "
        "well, which the thesis does not report."
    )
    heading = "V.C: when drag is confused with the propeller"
    section = table_section(heading, COLUMNS, thrust_alone_rows(comparison, study), text)
    return section | {"figures": [confusion_figure(study)]}


def thrust_alone_rows(comparison: Comparison, study: RawStudy) -> list[list[str]]:
    """The thesis' two statements with a propeller that loses thrust alone."""
    outputs = study.by_variant[THRUST_ALONE]
    named = first_drag_points_named(outputs, "degraded propeller")
    settled = points_until_drag(outputs)[BEST]
    normal = mean_and_std_percent(accuracy_by_mode(outputs)[BEST][:, 0])
    counts = " / ".join(mean_and_std(counts) for counts in named)
    many = named[BEST].mean() > 50
    in_time = is_in_time(settled)
    why = (
        f"Between 50 and 150 in {in_time.sum()} of {len(settled)} networks. Of the normal run "
        f"{normal} is named correctly."
    )

    def row(quantity, thesis, values, agrees, why):
        case = "beta -35 %, torque as before, drag +35 %:"
        quantity = f"{case} {quantity} after {CHECKPOINTS[BEST]:,}"
        ours = mean_and_std(values)
        return comparison.row("V.C, Figs 5.7-5.10", quantity, thesis, ours, "-", agrees, why)

    until = "points until drag's output stays the largest,"
    first = "of the first 100 points, named degraded propeller"
    return [
        row(first, "all", named[BEST], many, f"{counts} {AFTER}."),
        row(until, "100", settled, in_time.mean() > 0.5, why),
    ]


def confusion_figure(study: RawStudy) -> dict[str, Any]:
    """The confusion by the sizes of both faults."""
    counts = []
    texts = []
    for drag in DRAG_SEVERITIES:
        count_row = []
        text_row = []
        for propeller in PROPELLER_FAULTS:
            outputs = study.by_variant[drag, propeller]
            named = first_drag_points_named(outputs, "degraded propeller")[BEST]
            settled = points_until_drag(outputs)[BEST]
            count_row.append(round(float(named.mean()), 1))
            text_row.append(f"{mean_and_std(named)}\nfrom {mean_and_std(settled)}")
        counts.append(count_row)
        texts.append(text_row)
    caption = (
        "Of drag's first 100 points, those named degraded propeller, by the sizes of both faults; "
        "below them the point from which drag's output stays the largest (the thesis: all, and "
        f"100). Noise-free, after {CHECKPOINTS[BEST]:,} presentations, mean ± standard deviation "
        "over networks."
    )
    drags = [f"+{100 * drag:.0f} %" for drag in DRAG_SEVERITIES]
    data = {
        "drags": drags,
        "propellers": list(PROPELLER_FAULTS),
        "count": counts,
        "text": texts,
    }
    return figure("confusion_by_size", "drag-and-propeller", caption, data)


def settings_section(study: RawStudy) -> dict[str, Any]:
    """The study behind learning rate and momentum."""
    rows = []
    for (rate, momentum), outputs in study.by_settings.items():
        errors = [mean_and_std(error, ".3f") for error in rms_errors(outputs)]
        rows.append([f"{rate:g}", f"{momentum:g}", *errors])
    errors = [f"rms after {count:,}" for count in CHECKPOINTS]
    text = (
        "Training rms of 4-6-4 networks, noise-free, by setting and presentations; no other "
        f"quantity was compared. {LEARNING_RATE} and {MOMENTUM} lie in the flat middle; with "
        "momentum 0.9 training is unstable from 0.3 on."
    )
    columns = ["learning rate", "momentum", *errors]
    return table_section("V.C: learning rate and momentum", columns, rows, text)
