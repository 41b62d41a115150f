"""Colours differ for usual eyes and for eyes without one kind of cones."""

from itertools import combinations

import numpy as np
import pytest

from auv_fault_env.faults import classes
from training.report.colours import (
    CLASS_COLOURS,
    COLOURS,
    PORT,
    STARBOARD,
    class_style,
)

# what is seen of linear RGB: usual, without M cones, without L cones (Machado et al., 2009)
EYES = {
    "usual": np.eye(3),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
}
# linear RGB to Oklab (Ottosson, 2020)
TO_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
# of black and white, 1; the colours of COLOURS and of the classes are at least so far apart
LEAST_DISTANCE = {"usual": 0.12, "deuteranopia": 0.08, "protanopia": 0.08}


def seen(colour, eyes):
    values = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    visible = np.clip(EYES[eyes] @ linear, 0.0, 1.0)
    return TO_LAB @ np.cbrt(TO_CONES @ visible)


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize(
    "colours", [COLOURS, list(CLASS_COLOURS.values())], ids=["names", "classes"]
)
def test_all_colours_are_distinct(colours, eyes):
    for one, other in combinations(colours, 2):
        distance = np.linalg.norm(seen(one, eyes) - seen(other, eyes))
        assert distance > LEAST_DISTANCE[eyes], (one, other)


@pytest.mark.parametrize("eyes", EYES)
def test_the_sides_are_far_apart(eyes):
    distance = np.linalg.norm(seen(PORT, eyes) - seen(STARBOARD, eyes))
    assert distance > 0.14


def test_every_class_has_a_colour_of_its_own():
    assert set(classes()) == set(CLASS_COLOURS)
    assert len(set(CLASS_COLOURS.values())) == len(CLASS_COLOURS)


def test_sensors_are_dashed_and_a_class_that_was_added_has_a_colour():
    assert class_style("sensor:speed")[1] == "dashed"
    assert class_style("increased_drag")[1] == "solid"
    assert class_style("unknown")[1] == "dotted"
    assert class_style("ice_on_hull")[0] not in CLASS_COLOURS.values()
