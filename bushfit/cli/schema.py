"""`bushfit schema`: JSON Schemas of the files, for other programs and for editors."""

from dataclasses import replace
from typing import Any

import click

from bushfit.cli.options import command_called
from bushfit.cli.output import Output, with_output


@command_called("schema", "", "model")
@click.argument("name", required=False)
@with_output("nothing is written")
def command(name: str | None, output: Output) -> None:
    """Print the JSON Schema (draft 2020-12) of NAME on standard output; without NAME, list all names.

    A schema describes every key of a file and its unit. Programs that read results use the schemas of JSON files.
    TOML editors use the schemas of campaign, manifest and limits to complete and check keys while you type.

    With -o, writes <name>.schema.json; without NAME, writes the schemas of all files.
    """
    from bushfit.errors import error_location
    from bushfit.report.results import ResultFile
    from bushfit.schemas import DESCRIBED, schema

    with error_location(place="NAME"):
        documents = {
            schema_name: schema(schema_name) for schema_name in ([name] if name else DESCRIBED if output.output else ())
        }
    document: dict[str, Any] = (
        documents[name]
        if name
        else {**documents} or {schema_name: described.files for schema_name, described in DESCRIBED.items()}
    )
    if output.output:
        output.write(
            output.output,
            [ResultFile(f"{schema_name}.schema", "json", text) for schema_name, text in documents.items()],
            document,
        )
        return
    if name:
        output.print(f"{name} describes: {DESCRIBED[name].files}")
    else:
        rows = ((schema_name, described.files) for schema_name, described in DESCRIBED.items())
        output.print_table("schemas", ("name", "describes"), rows, text_columns=2)
    replace(output, as_json=output.as_json or name is not None).print_json(document)
