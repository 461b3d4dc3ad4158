"""Campaign files: TOML -> Campaign, in SI, with every measurement read."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from bushfit.errors import BushfitError, CampaignError, ModelError
from bushfit.files import read_utf8
from bushfit.geometry import Bushing
from bushfit.measurement import Loop, Sweep
from bushfit.output import folder_name
from bushfit.reading import read_loop, read_sweep
from bushfit.schema import (
    CampaignFile,
    FitSettings,
    LoopFile,
    PredictSettings,
    SimulateSettings,
    SweepFile,
    fit_keys,
    unknown_key,
)

_LARGEST_BYTES = 1_000_000
_UNKNOWN = "unexpected_keyword_argument"
#: pydantic's names for what has the wrong shape, in the words of TOML.
_SHAPES = {
    "dataclass_type": "a table",
    "dict_type": "a table",
    "mapping_type": "a table",
    "tuple_type": "a list",
    "too_short": "at least one value",
    "string_type": "a text in quotes",
    "string_too_short": "a text that is not empty",
    "bool_type": "true or false",
    "int_type": "a whole number",
}


@dataclass(frozen=True, eq=False)
class Campaign:
    """One bushing, its tests, and what to do with them.

    Args:
        name: of the campaign; default the name of the bushing.
        path: the campaign file.
        bushing: geometry [m].
        loops, sweeps: the measurements, SI.
        fit, predict: settings, SI; their defaults where the file has none.
        simulate: settings, SI; None where the file has none.
    """

    name: str
    path: Path
    bushing: Bushing
    loops: tuple[Loop, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    fit: FitSettings = field(default_factory=FitSettings)
    predict: PredictSettings = field(default_factory=PredictSettings)
    simulate: SimulateSettings | None = None

    @property
    def slug(self) -> str:
        """The name as that of one folder; it never leads out of the folder it is put in."""
        return folder_name(self.name)


def load_campaign(path: str | Path) -> Campaign:
    """Read a campaign file and the measurements that it names, each once.

    Raises:
        CampaignError: the file is missing, no TOML, or has keys or values that are not understood.
        UnitError: a quantity without a unit, or with one that does not fit.
        ModelError: an impossible bushing.
        MeasurementError: a measurement that cannot be used.
    """
    path = Path(path)
    content = _check(_parse(path), path)
    if not (content.loops or content.sweeps or content.simulate):
        raise CampaignError(
            "the campaign has no tests",
            file=path,
            expected="[[loops]] or [[sweeps]] tables, or a [simulate] table",
            hint='add [[loops]] with file = "..." and direction = "axial"',
        )
    try:
        bushing = Bushing(**vars(content.bushing))
    except ModelError as error:
        error.file = path
        raise
    return Campaign(
        content.name or bushing.name,
        path,
        bushing,
        tuple(read_loop(**keywords) for keywords in _keywords(path, content.loops)),
        tuple(read_sweep(**keywords) for keywords in _keywords(path, content.sweeps)),
        content.fit,
        content.predict,
        content.simulate,
    )


def _keywords(campaign: Path, tests: Sequence[LoopFile | SweepFile]) -> Iterator[dict[str, Any]]:
    """The reader's keywords for each file; it is named by its stem, or as the campaign lists it where stems agree."""
    stems = [Path(test.file).stem for test in tests]
    seen = set()
    for test, stem in zip(tests, stems, strict=True):
        file = campaign.parent / test.file
        if (place := os.path.normpath(file)) in seen:
            raise CampaignError("a file is listed twice", file=campaign, found=test.file, expected="each file once")
        seen.add(place)
        stated = {key: value for key, value in vars(test).items() if value is not None}
        name = stem if stems.count(stem) == 1 else test.file
        yield {**stated, "file": file, "name": name, "listed_as": Path(test.file)}


def _parse(path: Path) -> dict[str, Any]:
    """The tables of a TOML file."""
    data = read_utf8(path, CampaignError)
    if len(data) > _LARGEST_BYTES:
        raise CampaignError(
            "this is too large for a campaign file",
            file=path,
            found=f"{len(data)} bytes",
            expected=f"TOML of at most {_LARGEST_BYTES} bytes",
            hint="give the campaign file, not a measurement",
        )
    try:
        tables = tomllib.loads(data.decode("utf-8-sig"))
        repr(tables)  # an error may have to quote any part of it
    except ValueError as error:
        reason = re.fullmatch(r"(?P<problem>.*) \(at (?P<place>.*)\)", str(error), re.DOTALL)
        raise CampaignError(
            "this is not valid TOML",
            file=path,
            place=reason["place"] if reason else None,
            found=reason["problem"] if reason else str(error),
            expected='lines such as length = "34 mm"',
            hint="put texts and quantities in quotes",
        ) from error
    except RecursionError as error:
        raise CampaignError("the tables are nested too deeply", file=path, expected="plain tables") from error
    return tables


def _check(tables: Mapping[str, Any], file: Path) -> CampaignFile:
    try:
        return TypeAdapter(CampaignFile).validate_python(tables)
    except ValidationError as error:
        # a mistyped key is missing and unknown: the latter says more
        details = sorted(error.errors(include_url=False), key=lambda detail: detail["type"] != _UNKNOWN)
        complaint = _complaint(details[0])
        complaint.file = file
        raise complaint from None


def _complaint(detail: ErrorDetails) -> BushfitError:
    """One error of pydantic's as one of ours; tables of an array are counted from 1."""
    location = detail["loc"]
    place = ".".join(str(key) for key in location)
    cause = detail.get("ctx", {}).get("error")
    if isinstance(cause, ValueError) and isinstance(cause.args[0], BushfitError):
        error = cause.args[0]
        place = ".".join(part for part in (place, error.place) if part)
    elif detail["type"] == _UNKNOWN:
        error = unknown_key(str(location[-1]), _keys(_table_at(location[:-1])))
    elif detail["type"] == "missing":
        error = CampaignError("a key is missing", expected=f"{location[-1]} = ...")
    else:
        found = str(detail["input"])
        expected = _SHAPES.get(detail["type"], detail["msg"].removeprefix("Input should be "))
        error = CampaignError("this value is not understood", found=found, expected=expected)
    error.place = re.sub(r"\.(\d+)", lambda index: f" #{int(index[1]) + 1}", place.replace("fit.parameters.", "fit."))
    return error


def _keys(table: type) -> Sequence[str]:
    """The keys that a table of the file may have."""
    return fit_keys() if table is FitSettings else [entry.name for entry in fields(table)]


def _table_at(location: tuple[int | str, ...]) -> type:
    """The dataclass of the table at a place in the file."""
    table: type = CampaignFile
    for key in location:
        if key in (hints := get_type_hints(table)):
            table = next(part for part in _parts(hints[key]) if isinstance(part, type) and is_dataclass(part))
    return table


def _parts(hint: Any) -> Iterable[Any]:
    """A type and all that it is made of."""
    yield hint
    for part in get_args(hint):
        yield from _parts(part)
