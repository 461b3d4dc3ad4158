"""What a page reads of the JSON documents: pydantic checks them, so that what is spoiled is one clear error."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bushfit.diagnosis.document import DiagnosisFile
from bushfit.errors import ModelError
from bushfit.model.document import CampaignTable
from bushfit.model.file import from_document, require_schema
from bushfit.model.result import Result
from bushfit.validation import check_tables

#: Documents that hold a model, the one to use first.
MODELS = ("model", "dynamic", "static")
#: The plain fit, beside a model with what was added.
PLAIN = "joint"
#: What "schema" of a diagnosis says.
DIAGNOSIS = "bushfit/diagnosis/2"


@dataclass(frozen=True)
class _Model:
    campaign: CampaignTable | None = None


@dataclass(frozen=True, eq=False)
class Checked:
    """All documents of a result: the model to use, the plain fit beside it, the campaign, and the diagnosis."""

    result: Result
    plain: Result | None
    about: CampaignTable | None
    diagnosis: DiagnosisFile | None
    versions: Mapping[str, str]


def checked(documents: Mapping[str, Mapping[str, Any]], files: Mapping[str, Path] | None = None) -> Checked:
    """The documents by their names, checked; errors name the `files` that they were read from.

    Raises:
        ModelError: no model among them, or one that is spoiled.
    """
    at = files or {}
    name = next((name for name in MODELS if name in documents), None)
    if name is None:
        raise ModelError("there is no model among the results", expected=" or ".join(f"{name}.json" for name in MODELS))
    model, plain, diagnosis = documents[name], documents.get(PLAIN), documents.get("diagnosis")
    result = from_document(model, at.get(name))
    if diagnosis is not None:
        hint = "bushfit diagnose writes it anew"
        require_schema(diagnosis, at.get("diagnosis"), "a diagnosis", DIAGNOSIS, hint=hint)
    provenance = model.get("provenance", {})
    return Checked(
        result,
        from_document(plain, at.get(PLAIN)) if plain else None,
        check_tables(model, at.get(name), _Model, kind=ModelError).campaign,
        check_tables(diagnosis, at.get("diagnosis"), DiagnosisFile, kind=ModelError) if diagnosis is not None else None,
        {"bushfit": str(provenance.get("bushfit", "")), **_texts(provenance.get("packages"))},
    )


def _texts(versions: object) -> dict[str, str]:
    return {str(key): str(value) for key, value in versions.items()} if isinstance(versions, Mapping) else {}
