"""The page of ``python -m training.studies.ablation``, made from its results alone."""

from collections.abc import Mapping
from typing import Any

from training.report.cells import percent, with_interval
from training.report.sections import figure, figure_section, table_section

Results = Mapping[str, Any]


def page(results: Results) -> dict[str, Any]:
    """Title, introduction and sections."""
    return {
        "title": "Raw data, filters, or both?",
        "summary": _summary(results),
        "intro": [
            f"The same network ({results['architecture']}) on different inputs at 2 Hz, trained "
            f"{results['passes']} times over {results['episodes']} episodes with imperfect "
            f"sensors, {results['n_networks']} networks of each input; `filter_bank` on the same "
            "lanes for comparison. Faulty lanes of the suite `standard` "
            "under the thesis' stimulus, thresholds of one false alarm per hour, means over the "
            "networks, 95 % bootstrap intervals over the lanes.",
            "The filter bank is an input through its belief. The physical residuals, which "
            "`integrated` has as well, are not among the inputs.",
        ],
        "command": results["command"],
        "sections": [
            _scores(results),
            _training(results),
            _groups(results),
            _compared(results),
            _figure(results),
            _curves(results),
            _architectures(results),
        ],
    }


def _summary(results: Results) -> list[str]:
    """Which inputs are best, and what an input adds."""
    scores = results["scores"]
    times = {name: score["isolation"] for name, score in scores.items()}
    best = min(times, key=times.__getitem__)
    ranking = ", ".join(f"{name} {times[name]:.1f} s" for name in sorted(times, key=times.get))
    sentences = [
        f"The same network was trained on {len(scores) - 1} sets of inputs, "
        f"{results['n_networks']} times each, and compared with the filter bank.",
        f"{best} isolates soonest. Restricted means: {ranking}.",
    ]
    pair = results["compared"][-1]
    change = with_interval(pair["all"]["mean"], pair["all"]["interval"], 2, "+")
    low, high = pair["all"]["interval"]
    judgement = "more than chance" if low * high > 0.0 else "perhaps chance"
    sentences.append(
        f"With {pair['second']} instead of {pair['first']} the isolation time changes by "
        f"{change} s, {judgement}."
    )
    return sentences


def _scores(results: Results) -> dict[str, Any]:
    rows = [
        [
            name,
            with_interval(score["isolation"], score["isolation_interval"], 2),
            ", ".join(f"{time:.2f}" for time in score["isolation_of_networks"]),
            percent(score["isolated"]),
            with_interval(score["detection"], score["detection_interval"], 2),
            with_interval(score["macro_f1"], score["macro_f1_interval"], 3),
            f"{score['ece']:.3f}",
            f"{score['false_alarms']} in {score['hours']:.0f} h",
        ]
        for name, score in results["scores"].items()
    ]
    columns = [
        "inputs",
        "isolation, restricted mean [s]",
        "of each network [s]",
        "isolated",
        "detection [s]",
        "macro-F1 at 10 s",
        "ECE",
        "false alarms",
    ]
    return table_section("Scores", columns, rows)


def _training(results: Results) -> dict[str, Any]:
    rows = [
        [
            name,
            f"{curve['macro_f1'][-1]:.2f}",
            f"{curve['episodes_enough']:.0f}",
            f"{results['costs'][name]:.0f}",
        ]
        for name, curve in results["curves"].items()
    ]
    columns = [
        "inputs",
        "macro-F1 without a threshold",
        "90 % of it after episodes",
        "cost per sample, one lane [µs]",
    ]
    text = (
        "Without a threshold: the most probable class ten seconds after onset, on faulty "
        "validation lanes. The networks have learnt from episodes of a minute; thresholds are set "
        "on missions of up to two hours."
    )
    return table_section("Without a threshold, and costs", columns, rows, text)


def _groups(results: Results) -> dict[str, Any]:
    scores = results["scores"]
    groups = list(next(iter(scores.values()))["f1_of_groups"])
    rows = [
        [
            name,
            *(
                f"{score['isolation_of_groups'][group]:.1f}; {score['f1_of_groups'][group]:.2f}"
                for group in groups
            ),
        ]
        for name, score in scores.items()
    ]
    text = "Restricted mean of the isolation time [s]; F1 at 10 s, mean of the classes."
    return table_section("By kind of fault", ["inputs", *groups], rows, text)


def _compared(results: Results) -> dict[str, Any]:
    groups = [key for key in results["compared"][0] if key not in ("first", "second")]
    rows = [
        [
            f"{pair['second']} instead of {pair['first']}",
            *(
                with_interval(pair[group]["mean"], pair[group]["interval"], 2, "+")
                for group in groups
            ),
        ]
        for pair in results["compared"]
    ]
    text = "Change of the isolation time [s] on the same lanes; negative is sooner."
    return table_section("What an input adds", ["comparison", *groups], rows, text)


def _figure(results: Results) -> dict[str, Any]:
    scores = results["scores"]
    groups = list(next(iter(scores.values()))["f1_of_groups"])
    data = {
        "isolation": {name: score["isolation"] for name, score in scores.items()},
        "intervals": {name: score["isolation_interval"] for name, score in scores.items()},
        "groups": {
            group: {name: score["f1_of_groups"][group] for name, score in scores.items()}
            for group in groups
        },
    }
    caption = "Isolation time of all faults with 95 % intervals, and F1 by kind of fault."
    return figure_section("Inputs", "ablation_scores", "inputs", caption, data)


def _curves(results: Results) -> dict[str, Any]:
    caption = (
        "Loss on validation episodes, and macro-F1 of the most probable classes ten seconds after "
        "onset on faulty validation lanes; means over the networks."
    )
    shown = {"curves": results["curves"]}
    return {
        "heading": "Training",
        "text": [],
        "figures": [figure("ablation_curves", "training", caption, shown)],
    }


def _architectures(results: Results) -> dict[str, Any]:
    losses = results["architecture_losses"]
    rows = [[name, f"{loss:.4f}"] for name, loss in losses.items()]
    text = "Validation loss after one pass, on raw data and filters; the least is taken."
    return table_section("Choice of the architecture", ["architecture", "loss [nat]"], rows, text)
