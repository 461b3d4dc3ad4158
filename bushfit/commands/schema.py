"""schema: JSON Schemas (draft 2020-12) of the files that bushfit writes, and of the TOML files that it reads.

Each schema is generated on demand from the type that reads or writes the file. The descriptions of keys come from the
docstring of this type, so a schema cannot be out of date.
"""

import inspect
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Literal

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from typing_extensions import get_original_bases

from bushfit.errors import unknown_name
from bushfit.validation import inline_fields


@dataclass(frozen=True)
class FileDescription:
    """Kind of file that has a JSON Schema: its names, its type in bushfit, and how the schema treats missing keys.

    Args:
        files: names of the files, and commands whose `--json` prints the same content.
        type: module and name of the type of a whole file, below the package bushfit.
        way: "written" if every key is present; "read" if keys with a default may be missing, as in older files; "toml"
            if users write the file, which cannot contain null.
    """

    files: str
    type: str
    way: Literal["written", "read", "toml"]


#: Every schema by its name, as schemas.toml lists them.
DESCRIBED = {
    name: FileDescription(**row)
    for name, row in tomllib.loads(Path(__file__).with_name("schemas.toml").read_text(encoding="utf-8")).items()
}
#: Keywords of pydantic for a text that becomes a number; they are not part of JSON Schema.
_NO_KEYWORDS = frozenset({"gt", "ge", "lt", "le"})
#: The list of arguments in a docstring, up to its end or the next heading.
_ARGS = re.compile(r"^Args:\n(.*?)(?=^\S|\Z)", re.MULTILINE | re.DOTALL)
#: One or several argument names and their description.
_ARG = re.compile(r"^    (\S[^:]*): +(.*?)(?=^    \S|\Z)", re.MULTILINE | re.DOTALL)


def schema(name: str) -> dict[str, Any]:
    """JSON Schema of a file that bushfit reads or writes.

    Args:
        name: key of `DESCRIBED`, such as "campaign".

    Returns:
        The schema as JSON-compatible data.

    Raises:
        BushfitError: no schema has this name.
    """
    if name not in DESCRIBED:
        raise unknown_name("there is no such schema", name, DESCRIBED)
    described = DESCRIBED[name]
    adapter = TypeAdapter[Any](resolve_name(f"bushfit.{described.type}"))
    generated = adapter.json_schema(
        mode="serialization" if described.way == "written" else "validation",
        schema_generator=TomlSchema if described.way == "toml" else FileSchema,
    )
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:bushfit:schema:{name}",
        "title": f"bushfit {name}: {described.files}",
    }
    return {**head, **{key: value for key, value in _remove_unsupported(generated).items() if key != "title"}}


class FileSchema(GenerateJsonSchema):
    """Generator of the schema of a file that bushfit writes, with descriptions of the keys from docstrings."""

    def field_title_should_be_set(self, _: Any) -> bool:
        """No key has a title, because a title derived from the key adds no information."""
        return False

    def field_is_required(self, field: Any, total: bool) -> bool:
        """All keys are required in a file that is only written."""
        is_written = self.mode == "serialization" and field["type"] == "dataclass-field"
        return is_written or super().field_is_required(field, total)

    def dataclass_schema(self, schema: Any) -> dict[str, Any]:
        """Schema of a dataclass with the descriptions of its keys."""
        return _add_descriptions(super().dataclass_schema(schema), schema["cls"])

    def typed_dict_schema(self, schema: Any) -> dict[str, Any]:
        """Schema of a TypedDict with the descriptions of its keys."""
        return _add_descriptions(super().typed_dict_schema(schema), schema["cls"])


class TomlSchema(FileSchema):
    """Generator of the schema of a TOML file, which cannot contain null."""

    def nullable_schema(self, schema: Any) -> dict[str, Any]:
        """Schema of a value that may be missing."""
        return self.generate_inner(schema["schema"])


def _add_descriptions(table_schema: dict[str, Any], kind: type) -> dict[str, Any]:
    """Add the descriptions in the docstring of a table's type to its schema."""
    properties: dict[str, Any] = table_schema["properties"]
    descriptions: dict[str, str] = {}
    for base in (*get_original_bases(kind), *reversed(kind.__mro__)):  # a TypedDict has no other bases in its order
        found = _ARGS.search(re.sub(r"\bNone\b", "null", inspect.cleandoc(base.__doc__ or "")))
        for names, words in _ARG.findall(found[1]) if found else ():
            descriptions |= dict.fromkeys(names.split(", "), " ".join(words.split()))
    for key in properties.keys() & descriptions.keys():
        properties[key] = {**properties[key], "description": descriptions[key]}
    for field, keys in (inline_fields(kind) if is_dataclass(kind) else {}).items():
        value = properties.pop(field)
        inner = value.get("additionalProperties", value)
        table_schema["required"] = [key for key in table_schema.get("required", ()) if key != field]
        description_of = {key: {"description": descriptions[key]} for key in keys() if key in descriptions}
        table_schema["properties"] |= {key: inner | description_of.get(key, {}) for key in keys()}
        if inner is not value:  # places, such as specimens, have parameters that the library does not list
            table_schema["additionalProperties"] = inner
    words = inspect.cleandoc(kind.__doc__ or "").partition("\n\nArgs:")[0]
    return {**table_schema, "description": " ".join(words.split())}


def _remove_unsupported(node: Any) -> Any:
    """Remove keywords unknown to JSON Schema, and defaults of null, from a schema."""
    if isinstance(node, Mapping):
        keywords = (key for key, value in node.items() if key not in _NO_KEYWORDS and (key, value) != ("default", None))
        return {key: _remove_unsupported(node[key]) for key in keywords}
    return [_remove_unsupported(item) for item in node] if isinstance(node, list) else node
