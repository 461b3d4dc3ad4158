"""Model files: JSON -> a document in which every key that is read has the kind of value that it should."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

from pydantic import Field

from bushfit.errors import ModelError
from bushfit.geometry import Direction
from bushfit.reading.files import read_utf8
from bushfit.validation import Name, check_tables

#: A hundred times what a model with every effect of the library takes.
_LARGEST_BYTES = 10_000_000

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Text = Annotated[str, Field(strict=True)]
Matrix = tuple[tuple[Number, ...], ...]
Interval = tuple[Number, Number]


@dataclass(frozen=True)
class BushingEntry:
    name: Name
    inner_radius_m: Number
    outer_radius_m: Number
    length_m: Number


@dataclass(frozen=True)
class ParameterEntry:
    value: Number
    vary: Annotated[bool, Field(strict=True)] = False


@dataclass(frozen=True)
class CovarianceEntry:
    names: tuple[Text, ...]
    matrix: Matrix
    spread: tuple[Matrix, ...] = ()

    def __post_init__(self) -> None:
        size = len(self.names)
        for matrix in (self.matrix, *self.spread):
            if len(matrix) != size or any(len(row) != size for row in matrix):
                rows = f"{len(matrix)} rows of {' or '.join(sorted({str(len(row)) for row in matrix})) or 'no'} numbers"
                raise ValueError(ModelError("no covariance of its names", found=rows, expected=f"{size} x {size}"))
        if any(self.matrix[i][i] < 0.0 for i in range(size)):
            raise ValueError(ModelError("a variance below zero", place="matrix", expected="squares on the diagonal"))


@dataclass(frozen=True)
class FitEntry:
    nrmse: Number
    reduced_chi_square: Number
    points: Annotated[int, Field(strict=True)]
    noise: Number
    frequency_Hz: Interval | None = None  # noqa: N815
    strain: Interval | None = None
    directions: tuple[Direction, ...] = ()


@dataclass(frozen=True)
class InputEntry:
    file: Text
    sha256: Text


@dataclass(frozen=True)
class ProvenanceEntry:
    inputs: tuple[InputEntry, ...] = ()


@dataclass(frozen=True)
class ModelFile:
    """What is read of a model file; other keys are left alone."""

    bushing: BushingEntry
    effects: tuple[Text, ...]
    parameters: Mapping[str, ParameterEntry]
    covariance: CovarianceEntry | None = None
    fit: FitEntry | None = None
    warnings: tuple[Text, ...] = ()
    provenance: ProvenanceEntry | None = None


def read_model_file(file: Path, schema: str) -> dict[str, Any]:
    """The document of a model file.

    Raises:
        ModelError: a file that is missing or too large, is no JSON, names another schema, or has a key that is missing,
            given twice, or of the wrong kind.
    """
    data = read_utf8(file, ModelError, largest=_LARGEST_BYTES, hint="bushfit fit writes a model.json")
    document = _parse(data.decode("utf-8-sig"), file)
    if not isinstance(document, dict):
        raise ModelError("not a model", file=file, found=_kind(document), expected="a JSON object { ... }")
    if document.get("schema") != schema:
        raise ModelError(
            "not a model this version reads",
            file=file,
            place="schema",
            found=repr(document.get("schema")),
            expected=schema,
            hint="use a file written by bushfit fit-static, fit-dynamic, fit or diagnose",
        )
    check_tables(document, file, ModelFile, kind=ModelError)
    return document


def _parse(text: str, file: Path) -> Any:
    place, found = None, "brackets in brackets, too deep"
    try:
        return json.loads(text, object_pairs_hook=_without_doubles, parse_constant=_no_number)
    except json.JSONDecodeError as wrong:
        place, found = f"line {wrong.lineno}, column {wrong.colno}", wrong.msg
    except ValueError as wrong:
        found = "a whole number of thousands of digits" if "int_max" in str(wrong) else str(wrong)
    except RecursionError:
        pass
    raise ModelError(
        "this is not valid JSON",
        file=file,
        place=place,
        found=found,
        expected="a model file",
        hint="give the file as bushfit fit wrote it",
    )


def _without_doubles(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f'the key "{next(key for key in keys if keys.count(key) > 1)}" twice')
    return table


def _no_number(constant: str) -> NoReturn:
    raise ValueError(f"{constant}, which is no number")


def _kind(value: object) -> str:
    kinds = {list: "a list", str: "a text", bool: "true or false", int: "a number", float: "a number"}
    return kinds.get(type(value), "null")
