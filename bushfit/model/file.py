"""Reading and writing of model files: a result as JSON with the keys of `model.document`."""

import importlib.metadata
import json
from collections.abc import Mapping
from dataclasses import asdict, astuple, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bushfit.caveat import to_caveats
from bushfit.effects import ORIGINS
from bushfit.errors import ModelError, error_location
from bushfit.geometry import Bushing, Specimen
from bushfit.model.covariance import Covariance
from bushfit.model.document import (
    SCHEMA,
    AlternativeTable,
    BushingTable,
    CovarianceTable,
    FitTable,
    InputTable,
    ModelFile,
    ParameterTable,
    ProvenanceTable,
    SpecimenTable,
)
from bushfit.model.laws import require_effect
from bushfit.model.model import Model
from bushfit.model.result import Alternative, Result
from bushfit.reading.files import read_utf8
from bushfit.reading.measurement import Source
from bushfit.validation import to_json_data, validate_tables
from bushfit.version import __version__

#: Maximum size of a model file [bytes]: a hundred times that of a model with every effect of the library.
_LARGEST_BYTES = 10_000_000
#: Packages whose versions a model file records.
_PACKAGES = ("numpy", "scipy", "lmfit")
#: Names of JSON values that are not objects.
_KINDS = {list: "a list", str: "a text", bool: "true or false", int: "a number", float: "a number"}


def load_result(file: Path) -> Result:
    """Read a model file (JSON) as a fit result.

    Raises:
        ModelError: the file is missing, too large or not JSON, has another schema, or an invalid key or value.
    """
    return from_document(read_document(file, "a model"), file)


def read_document(file: Path, kind: str = "a result") -> dict[str, Any]:
    """Read any JSON result file, such as a model or a diagnosis, as a dictionary, without checking its keys.

    Args:
        file: path of the file.
        kind: name of the expected content for errors.

    Returns:
        The JSON object with its keys and values.

    Raises:
        ModelError: the file is missing, too large or not a JSON object, or repeats a key.
    """
    data = read_utf8(file, ModelError, largest=_LARGEST_BYTES, hint="bushfit fit writes a model.json")
    try:
        document = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_refuse_duplicates)
    except (ValueError, RecursionError) as error:
        hint = "use the file unchanged, as bushfit fit wrote it"
        raise ModelError(
            "this is not valid JSON", file=file, found=str(error), expected="a model file", hint=hint
        ) from error
    if isinstance(document, dict):
        return document
    found = _KINDS.get(type(document), "null")
    raise ModelError(f"not {kind}", file=file, found=found, expected="a JSON object { ... }")


def from_document(document: Mapping[str, Any], file: Path | None = None) -> Result:
    """Convert a parsed model file to a result.

    Args:
        document: parsed JSON.
        file: path of the model file, for error messages.

    Returns:
        The result, with a valid model.

    Raises:
        ModelError: the schema is another one, a key is missing or invalid, or the values are not a valid model.
    """
    hint = "use a file written by bushfit fit-static, fit-dynamic, fit or diagnose"
    require_schema(document, file, "a model", SCHEMA, hint=hint)
    tables = validate_tables(document, file, ModelFile, kind=ModelError)
    entries, fit, covariance = tables.parameters, tables.fit, Covariance()
    values = {name: entry.value for name, entry in entries.items()}
    with error_location(file):
        law_warnings = tuple(filter(None, (require_effect(name, origin) for name, origin in tables.laws.items())))
        bushing = Bushing(*astuple(tables.bushing)) if tables.bushing else None
        model = Model(bushing, tables.effects, values, tables.unnamed)
        if tables.covariance:
            covariance = _covariance(tables.covariance, model)
        alternatives = []
        for rank, row in enumerate(tables.alternatives, 1):
            with error_location(place=f"alternatives, #{rank}"):
                rival = Model(bushing, row.effects, row.values, row.unnamed)
                alternatives.append(Alternative(rival, row.probability, _covariance(row.covariance, rival)))
        result = Result(
            model,
            fitted=tuple(name for name, entry in entries.items() if entry.vary),
            covariance=covariance,
            quality=fit.quality if fit else None,
            measured=fit.measured if fit else None,
            warnings=(*to_caveats(tables.warnings, tables.warning_kinds), *law_warnings),
            inputs=tuple(Source(Path(test.file), test.sha256, test.conditions) for test in tables.provenance.inputs),
            outliers=tables.outliers,
            profile={name: entry.profile95 for name, entry in entries.items() if entry.profile95},
            at_bound={name: entry.at_bound for name, entry in entries.items() if entry.at_bound},
            specimens=(
                *(place for table in tables.bushings for place in Specimen.of_bushing(Bushing(*astuple(table)))),
                *(Specimen(*astuple(specimen)) for specimen in tables.specimens),
            ),
            tests=fit.tests if fit else (),
            usable=fit.usable if fit else (),
            unresolved=tuple(name for name in tables.unresolved if name in model.effects),
            model_error=tables.model_error,
            campaign=tables.campaign,
            alternatives=tuple(alternatives),
            ties={name: entry.tied for name, entry in entries.items() if entry.tied},
            priors={name: entry.prior for name, entry in entries.items() if entry.prior},
        )
        with error_location(place="fit, directions"):
            for name in result.measured.directions if result.measured else ():
                result.place(name)
    return result


def _covariance(table: CovarianceTable, model: Model) -> Covariance:
    """Read the covariance of the parameters of a model; raise a ModelError if it contains other parameters."""
    if not set(table.names) <= model.parameters.keys():
        raise ModelError("the covariance does not belong to the parameters", place="covariance")
    matrix, *spread = (np.reshape(part, 2 * [len(table.names)]) for part in (table.matrix, *table.spread))
    return Covariance(table.names, matrix, tuple(spread))


def _covariance_table(covariance: Covariance) -> CovarianceTable:
    """Entry of a model file for a covariance."""
    matrix, *spread = (tuple(map(tuple, part.tolist())) for part in (covariance.matrix, *covariance.spread))
    return CovarianceTable(covariance.names, matrix, tuple(spread))


def to_document(result: Result) -> dict[str, Any]:
    """Convert a result to the JSON data of a model file.

    Returns:
        Content of the model file, as dictionaries, lists, texts and numbers.
    """
    model, covariance, fit = result.model, result.covariance, None
    if result.quality and (measured := result.measured):
        fit = FitTable(
            **asdict(result.quality),
            frequency_Hz=measured.frequency,
            strain=measured.strain,
            directions=measured.directions,
            temperature_K=measured.temperature,
            preloads=measured.preloads,
            tests=result.tests,
            usable=result.usable,
        )
    parameters = {
        name: ParameterTable(
            value=float(model.values[name]),
            unit=parameter.unit,
            stderr=covariance.stderr(name),
            ci95=result.interval(name),
            vary=name in result.fitted,
            profile95=result.profile.get(name),
            at_bound=result.at_bound.get(name),
            tied=result.ties.get(name),
            prior=result.priors.get(name),
        )
        for name, parameter in model.parameters.items()
    }
    inputs = (InputTable(str(source.file), source.sha256, dict(source.conditions)) for source in result.inputs)
    tables = ModelFile(
        schema=SCHEMA,
        bushing=BushingTable(*astuple(model.bushing)) if model.bushing else None,
        effects=tuple(effect.name for effect in model.records),
        laws={
            name: ORIGINS[name]
            for used_model in (model, *(alternative.model for alternative in result.alternatives))
            for name in used_model.effects
            if name in ORIGINS
        },
        parameters=parameters,
        bushings=tuple(BushingTable(*astuple(bushing)) for bushing in result.bushings),
        specimens=tuple(
            SpecimenTable(*astuple(coupon)[: len(fields(SpecimenTable))])
            for coupon in result.specimens
            if not coupon.bushing
        ),
        covariance=_covariance_table(covariance),
        fit=fit,
        unresolved=result.unresolved,
        unnamed=model.unnamed,
        model_error=result.model_error,
        alternatives=tuple(
            AlternativeTable(
                rival.model.effects,
                dict(rival.model.values),
                rival.probability,
                _covariance_table(rival.covariance),
                rival.model.unnamed,
            )
            for rival in result.alternatives
        ),
        warnings=tuple(warning.text for warning in result.warnings),
        warning_kinds=tuple(warning.kind for warning in result.warnings),
        outliers=result.outliers,
        provenance=ProvenanceTable(__version__, tuple(inputs), versions()),
        campaign=result.campaign,
    )
    return dict(to_json_data(tables, ModelFile))


def require_schema(document: Mapping[str, Any], file: Path | None, kind: str, *schemas: str, hint: str) -> None:
    """Raise an error if a document does not have one of the valid schemas.

    Args:
        document: parsed JSON object.
        file: path of the document, for the error message.
        kind: name of the expected document for the error message, such as "a model".
        schemas: valid values of the key "schema".
        hint: next step for the user.

    Raises:
        ModelError: the document has another schema or none.
    """
    if document.get("schema") not in schemas:
        raise ModelError(
            f"this version cannot read the file as {kind}",
            file=file,
            place="schema",
            found=repr(document.get("schema")),
            expected=" or ".join(schemas),
            hint=hint,
        )


@cache
def versions() -> dict[str, str]:
    """Versions of the numerical packages by name, for the provenance of a model file; cached."""
    return {name: importlib.metadata.version(name) for name in _PACKAGES}


def _refuse_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Convert the keys and values of a JSON object to a dictionary; raise a ValueError if a key occurs twice."""
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f'the key "{next(key for key in keys if keys.count(key) > 1)}" twice')
    return table
