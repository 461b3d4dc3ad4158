"""Model files: a result as JSON in the schema bushfit/model/1, or /2 with specimens, and back.

Its keys are those of `model.document`.
"""

import importlib.metadata
import json
from collections.abc import Mapping, Set
from dataclasses import asdict, astuple
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.errors import ModelError, error_location
from bushfit.geometry import Bushing, Specimen
from bushfit.model.covariance import Covariance
from bushfit.model.document import SCHEMAS, AlternativeTable, CovarianceTable, ModelFile
from bushfit.model.model import Model
from bushfit.model.result import Alternative, Quality, Range, Result
from bushfit.reading.files import read_utf8
from bushfit.validation import validate_tables
from bushfit.version import __version__

#: The effect that older files have in place of a factor of its own for the radial direction, and its parameter.
_RADIAL_FACTOR = ("radial_factor", "radial_factor.excess")
#: That effect and its parameter as they are called today.
_FACTOR = "stiffness_factor.radial"
#: Size of a model file at most [bytes]: a hundred times what a model with every effect of the library takes.
_LARGEST_BYTES = 10_000_000
#: Packages that the numbers rest on; a model file records their versions.
_PACKAGES = ("numpy", "scipy", "lmfit")

#: What JSON calls values that are no object.
_KINDS = {list: "a list", str: "a text", bool: "true or false", int: "a number", float: "a number"}


def load_result(file: Path) -> Result:
    """Read a model file.

    Raises:
        ModelError: a file that is missing or too large, is no JSON, names another schema, or has a key that is missing,
            given twice, or of the wrong kind; it names the file.
    """
    return from_document(_read_json(file), file)


def read_document(file: Path) -> dict[str, Any]:
    """A JSON document of a result, as it stands in a file.

    Raises:
        ModelError: as `load_result`, of any schema.
    """
    return _object(_read_json(file), file, "a result")


def _read_json(file: Path) -> Any:
    data = read_utf8(file, ModelError, largest=_LARGEST_BYTES, hint="bushfit fit writes a model.json")
    return _parse(data.decode("utf-8-sig"), file)


def from_document(document: object, file: Path | None = None) -> Result:
    """The result that a parsed model file holds.

    Raises:
        ModelError: another schema, a key that is missing or of the wrong kind, or values that are no model.
    """
    hint = "use a file written by bushfit fit-static, fit-dynamic, fit or diagnose"
    tables = _object(document, file, "a model")
    require_schema(tables, file, "a model", *SCHEMAS, hint=hint)
    checked = validate_tables(_up_to_date(_renamed(tables), file), file, ModelFile, kind=ModelError)
    with error_location(file):
        return _result(checked)


def _object(document: object, file: Path | None, what: str) -> dict[str, Any]:
    """A parsed file that is a JSON object, or a ModelError."""
    if isinstance(document, dict):
        return document
    found = _KINDS.get(type(document), "null")
    raise ModelError(f"not {what}", file=file, found=found, expected="a JSON object { ... }")


def require_schema(document: Mapping[str, Any], file: Path | None, what: str, *schemas: str, hint: str) -> None:
    """Refuse a document of another schema.

    Raises:
        ModelError: it names none of these.
    """
    if document.get("schema") not in schemas:
        raise ModelError(
            f"not {what} this version reads",
            file=file,
            place="schema",
            found=repr(document.get("schema")),
            expected=" or ".join(schemas),
            hint=hint,
        )


def _result(tables: ModelFile) -> Result:
    """The result of checked tables."""
    tube, entries, fit = tables.bushing, tables.parameters, tables.fit
    model = Model(
        Bushing(*astuple(tube)) if tube else None,
        tables.effects,
        {name: entry.value for name, entry in entries.items()},
        tables.unnamed,
    )
    result = Result(
        model,
        fitted=tuple(name for name, entry in entries.items() if entry.vary),
        covariance=_covariance(tables.covariance, model.parameters.keys()) if tables.covariance else Covariance(),
        quality=fit.quality if fit else None,
        measured=fit.measured if fit else None,
        warnings=tables.warnings,
        inputs=tables.provenance.inputs,
        outliers=tables.outliers,
        profile={name: entry.profile95 for name, entry in entries.items() if entry.profile95},
        at_bound={name: entry.at_bound for name, entry in entries.items() if entry.at_bound},
        specimens=tuple(Specimen(*astuple(table)) for table in tables.specimens),
        tests=fit.tests if fit else (),
        usable=fit.usable if fit else (),
        unresolved=tuple(name for name in tables.unresolved if name in model.effects),
        model_error=tables.model_error,
        campaign=tables.campaign,
        alternatives=tuple(_alternative_of(each, number, model) for number, each in enumerate(tables.alternatives, 1)),
    )
    with error_location(place="fit, directions"):
        for name in result.measured.directions if result.measured else ():
            result.place(name)
    return result


def _alternative_of(table: AlternativeTable, number: int, model: Model) -> Alternative:
    """One of the alternatives of a model, with the data of its correction where it has that too."""
    with error_location(place=f"alternatives, #{number}"):
        unnamed = model.unnamed if UNNAMED in table.effects else None
        return Alternative(Model(model.bushing, table.effects, table.values, unnamed), table.probability)


def _covariance(table: CovarianceTable, parameters: Set[str]) -> Covariance:
    if not set(table.names) <= parameters:
        raise ModelError("the covariance does not belong to the parameters", place="covariance")
    size = len(table.names)
    matrix, *spread = (np.reshape(part, (size, size)) for part in (table.matrix, *table.spread))
    return Covariance(table.names, matrix, tuple(spread))


def to_document(result: Result) -> dict[str, Any]:
    """The result as JSON-ready data in one of SCHEMAS."""
    model, covariance = model_document(result.model), result.covariance
    return {
        "schema": SCHEMAS[bool(result.specimens)],
        **model,
        **({"specimens": [_specimen(specimen) for specimen in result.specimens]} if result.specimens else {}),
        "parameters": {name: entry | _uncertainty(result, name) for name, entry in model["parameters"].items()},
        "covariance": {
            "names": list(covariance.names),
            "matrix": covariance.matrix.tolist(),
            "spread": [part.tolist() for part in covariance.spread],
        },
        "fit": _fit(result, result.quality, result.measured) if result.quality and result.measured else None,
        **({"unresolved": list(result.unresolved)} if result.unresolved else {}),
        **({"model_error": asdict(result.model_error)} if result.model_error else {}),
        **({"alternatives": [_alternative(each) for each in result.alternatives]} if result.alternatives else {}),
        "warnings": list(result.warnings),
        "outliers": [asdict(outlier) for outlier in result.outliers],
        "provenance": {
            "bushfit": __version__,
            "inputs": [
                {"file": str(source.file), "sha256": source.sha256}
                | ({"conditions": dict(source.conditions)} if source.conditions else {})
                for source in result.inputs
            ],
            "packages": dict(versions()),
        },
    }


def _alternative(each: Alternative) -> dict[str, Any]:
    model = each.model
    return {"effects": list(model.effects), "values": dict(model.values), "probability": each.probability}


def model_document(model: Model) -> dict[str, Any]:
    """The model as JSON-ready data: bushing, effects, parameters with value and unit."""
    bushing = model.bushing
    return {
        "bushing": bushing
        and {
            "name": bushing.name,
            "inner_radius_m": bushing.inner_radius,
            "outer_radius_m": bushing.outer_radius,
            "length_m": bushing.length,
            **({"shape": bushing.shape} if bushing.shape != "paper" else {}),
        },
        "effects": [effect.name for effect in model.records],
        "parameters": {
            name: {"value": float(model.values[name]), "unit": parameter.unit}
            for name, parameter in model.parameters.items()
        },
        **({UNNAMED: asdict(model.unnamed)} if model.unnamed else {}),
    }


def _specimen(specimen: Specimen) -> dict[str, Any]:
    sizes = {"area_m2": specimen.area, "thickness_m": specimen.thickness, "elements": specimen.elements}
    of_kind = {"strain": specimen.strain} if specimen.kind == "modulus" else sizes
    return {"name": specimen.name, "kind": specimen.kind, **of_kind}


def _renamed(document: dict[str, Any]) -> dict[str, Any]:
    """A document with the factor of the radial direction as it is called today: 1 + excess, of the same uncertainty."""
    old, excess = _RADIAL_FACTOR
    if not (isinstance(effects := document.get("effects"), list) and old in effects):
        return document
    text = json.dumps(document).replace(f'"{excess}"', f'"{_FACTOR}"').replace(f'"{old}"', f'"{_FACTOR}"')
    renamed = json.loads(text)
    entry = renamed["parameters"].get(_FACTOR) if isinstance(renamed.get("parameters"), dict) else None
    if isinstance(entry, dict) and isinstance(entry.get("value"), int | float):
        entry["value"] += 1.0
        if isinstance(entry.get("profile95"), list):
            entry["profile95"] = [None if end is None else 1.0 + end for end in entry["profile95"]]
    return renamed


def _up_to_date(document: dict[str, Any], file: Path | None) -> dict[str, Any]:
    """A document without the tilt and the peak that corrections could have once: none is read that has them."""
    kept = dict(document)
    for name in ("unnamed", "model_error"):
        if not isinstance(correction := document.get(name), dict):
            continue
        if correction.get("tilt") or correction.get("peak"):
            raise ModelError(
                "a correction of a form that this version does not read",
                file=file,
                place=name,
                found="a tilt or a peak",
                expected="neither",
                hint="bushfit diagnose finds the correction anew",
            )
        kept[name] = {key: value for key, value in correction.items() if key not in ("tilt", "peak")}
        if isinstance(patches := correction.get("patches"), list):
            once = ("peak_in_phase", "peak_in_quadrature")
            kept[name]["patches"] = [
                {key: value for key, value in patch.items() if key not in once} if isinstance(patch, dict) else patch
                for patch in patches
            ]
    return kept


def _uncertainty(result: Result, name: str) -> dict[str, Any]:
    """What a fit says of a parameter beside its value."""
    interval = result.interval(name)
    entry: dict[str, Any] = {
        "stderr": result.covariance.stderr(name),
        "ci95": None if interval is None else list(interval),
    }
    if name in result.profile:
        entry["profile95"] = list(result.profile[name])
    if name in result.at_bound:
        entry["at_bound"] = result.at_bound[name]
    return entry | {"vary": name in result.fitted}


def _fit(result: Result, quality: Quality, measured: Range) -> dict[str, Any]:
    return {
        **asdict(quality),
        "frequency_Hz": list(measured.frequency),
        "strain": list(measured.strain),
        "directions": list(measured.directions),
        **({"temperature_K": list(measured.temperature)} if measured.temperature else {}),
        "tests": [asdict(test) for test in result.tests],
        "usable": [asdict(place) for place in result.usable],
    }


@cache
def versions() -> dict[str, str]:
    """Versions of the packages that the numbers rest on; reading them takes as long as a tenth of a fit."""
    return {name: importlib.metadata.version(name) for name in _PACKAGES}


def _parse(text: str, file: Path) -> Any:
    """The parsed JSON of a model file; every way in which it can be wrong is one ModelError."""
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
