"""A row of the leaderboard: a JSON file with a score and all that it can be recomputed from."""

import json
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from auv_fault_env.errors import (
    InputError,
    finite_in_range,
    known_name,
    pair_in_range,
    refusal,
    whole_number,
)
from auv_fault_env.printable import printable
from auv_fault_env.text_files import text_of
from diagnosers.third_party import NAME
from training.benchmark.trials import PARTS
from training.submissions.draw import Draw, Recipe
from training.submissions.scoring import FIGURES, Examined, Figure
from training.submissions.submission import digest_of

SHA = re.compile(r"[0-9a-f]{64}")
LARGEST = 1e9  # of a figure
# of a row in the leaderboard: faulty episodes, and healthy operation for each purpose [h]
LEAST_LANES = 100
LEAST_HOURS = 2.0
LONGEST_TEXT = 500
UPDATE = ("p50_us", "p99_us", "many_lanes_us")
SCORED_BY = ("version", "revision", "code")
RECIPE = tuple(Recipe.__dataclass_fields__)


@dataclass(frozen=True)
class Row:
    """A scored submission."""

    name: str
    target: str
    files: Mapping[str, str]  # SHA-256 by name
    recipe: Recipe
    nonce: str
    nonce_from: str | None  # where somebody else has published the nonce; None: unverified
    seeds: Mapping[str, Mapping[str, int]]  # first and count by part
    episodes: str  # hash of the suite
    figures: Mapping[str, Figure]
    update: Mapping[str, float]  # what an update costs [us]
    scored_by: Mapping[str, str | None]  # version, revision and digest of the code

    def __post_init__(self):
        if not NAME.fullmatch(self.name):
            raise refusal("name", self.name, "a name of a diagnoser", "restore it")
        first = {part: seeds["first"] for part, seeds in self.seeds.items()}
        if first != self.draw.first_seeds:
            allowed = f"those of its recipe, files and nonce, {self.draw.first_seeds}"
            raise refusal("first seeds", first, allowed, "restore the row, or score it again")
        if self.seeds["faulty"]["count"] != self.recipe.lanes:
            count = self.seeds["faulty"]["count"]
            raise refusal("faulty seeds", count, f"{self.recipe.lanes} lanes", "restore the row")

    @property
    def digest(self) -> str:
        """That of the submission."""
        return digest_of(self.target, self.files)

    @property
    def draw(self) -> Draw:
        """What chose its seeds."""
        return Draw(self.recipe, self.digest, self.nonce)

    def text(self) -> str:
        """The row as JSON."""
        content = asdict(self)
        content["figures"] = {key: one._asdict() for key, one in self.figures.items()}
        content["submission"] = self.digest
        return json.dumps(content, indent=1, allow_nan=False) + "\n"


def row_of(
    draw: Draw,
    target: str,
    files: Mapping[str, str],
    nonce_from: str | None,
    examined: Examined,
    figures: Mapping[str, Figure],
    scored_by: Mapping[str, str | None],
) -> Row:
    """The row of a scored submission."""
    plan = draw.plan
    [stimulus] = plan.stimuli
    counts = {part: len(plan.episodes(part, stimulus)) for part in PARTS}
    first = draw.first_seeds
    return Row(
        name=examined.name,
        target=target,
        files=files,
        recipe=draw.recipe,
        nonce=draw.nonce,
        nonce_from=nonce_from,
        seeds={part: {"first": first[part], "count": counts[part]} for part in PARTS},
        episodes=plan.suite.content_hash,
        figures=figures,
        update=examined.update,
        scored_by=scored_by,
    )


def read(path: Path) -> Row:
    """The row in a file; refused if a field is missing, unknown or not what was computed."""
    text = text_of(path, "row", "a readable row of `auv-fault submit`")
    try:
        return _parsed(json.loads(text))
    except InputError as error:
        raise InputError(f"row {path}: {error}") from None
    except (RecursionError, ValueError) as error:
        raise refusal(f"row {path}", printable(str(error)), "JSON", "restore the file") from None


def read_all(folder: Path) -> dict[Path, Row]:
    """All rows of a folder by file; one on too few episodes, or there twice, is refused."""
    if not folder.is_dir():
        raise refusal("rows", str(folder), "a folder of rows", "check the path")
    rows: dict[Path, Row] = {}
    scored: dict[tuple[str, str], Path] = {}
    for path in sorted(folder.glob("*.json")):
        row = read(path)
        _check_size(path, row.recipe)
        for identity in (row.digest, row.name):
            earlier = scored.setdefault((identity, row.recipe.suite), path)
            if earlier != path:
                thing = f"rows {earlier} and {path}"
                allowed = "one row of a submission and of a name for each suite"
                raise refusal(thing, identity, allowed, "keep one of them")
        rows[path] = row
    return rows


def _check_size(path: Path, recipe: Recipe) -> None:
    hours = min(recipe.hours, recipe.counting_hours)
    if recipe.lanes < LEAST_LANES or hours < LEAST_HOURS:
        got = f"{recipe.lanes} faulty episodes, {recipe.hours:g} h and {recipe.counting_hours:g} h"
        allowed = f"at least {LEAST_LANES} episodes, {LEAST_HOURS:g} h and {LEAST_HOURS:g} h"
        raise refusal(f"row {path}", got, allowed, "score it again on more")


def _parsed(content: Any) -> Row:
    names = [*Row.__dataclass_fields__, "submission"]
    fields = _fields("row", content, names)
    recipe = Recipe(**_fields("recipe", fields["recipe"], RECIPE))
    nonce_from = fields["nonce_from"]
    row = Row(
        name=_text("name", fields["name"]),
        target=_text("target", fields["target"]),
        files=_each("files", fields["files"], None, _sha),
        recipe=recipe,
        nonce=_text("nonce", fields["nonce"]),
        nonce_from=None if nonce_from is None else _text("nonce_from", nonce_from),
        seeds=_each("seeds", fields["seeds"], PARTS, _range),
        episodes=_sha("episodes", fields["episodes"]),
        figures=_each("figures", fields["figures"], tuple(FIGURES), _figure),
        update=_each("update", fields["update"], UPDATE, _number),
        scored_by=_each("scored_by", fields["scored_by"], SCORED_BY, _text_or_none),
    )
    if fields["submission"] != row.digest:
        allowed = f"that of target and files, {row.digest}"
        raise refusal("submission", fields["submission"], allowed, "restore the row")
    return row


def _fields(thing: str, value: Any, names: Collection[str]) -> Mapping[str, Any]:
    """The value if it is an object with exactly these fields."""
    if not isinstance(value, dict):
        raise refusal(thing, value, "a JSON object", "restore the row")
    for name in value:
        known_name(f"field of {thing}", name, names)
    for name in names:
        if name not in value:
            raise refusal(f"field {name} of {thing}", "none", "one", "restore the row")
    return value


def _each(
    thing: str,
    value: Any,
    names: Collection[str] | None,
    checked: Callable[[str, Any], Any],
) -> dict[str, Any]:
    """The checked values of an object, with these fields, or with any."""
    found = _fields(thing, value, names or (value if isinstance(value, dict) else ()))
    return {name: checked(f"{thing}, {printable(name)}", one) for name, one in found.items()}


def _text(thing: str, value: Any) -> str:
    is_text = isinstance(value, str) and 0 < len(value) <= LONGEST_TEXT
    if not is_text or printable(value) != value:
        raise refusal(thing, value, f"up to {LONGEST_TEXT} printable characters", "restore the row")
    return value


def _text_or_none(thing: str, value: Any) -> str | None:
    return None if value is None else _text(thing, value)


def _sha(thing: str, value: Any) -> str:
    if not SHA.fullmatch(_text(thing, value)):
        raise refusal(thing, value, "a SHA-256, 64 hexadecimal digits", "restore the row")
    return value


def _range(thing: str, value: Any) -> dict[str, int]:
    fields = _fields(thing, value, ("first", "count"))
    return {
        "first": whole_number(f"{thing}, first", fields["first"], 0),
        "count": whole_number(f"{thing}, count", fields["count"]),
    }


def _number(thing: str, value: Any) -> float:
    return finite_in_range(thing, value, 0.0, LARGEST)


def _figure(thing: str, value: Any) -> Figure:
    fields = _fields(thing, value, Figure._fields)
    interval = pair_in_range(f"{thing}, interval", fields["interval"], 0.0, LARGEST)
    return Figure(_number(thing, fields["value"]), interval)
