"""`bushfit schema`: JSON Schemas of the files, for other programs and for editors."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import click

from bushfit.cli.options import command_called
from bushfit.cli.output import Output, with_output


@command_called("schema", "", "model")
@click.argument("name", required=False)
@with_output("nothing is written")
def command(name: str | None, output: Output) -> None:
    """Print the JSON Schema (draft 2020-12) of NAME; without NAME, list all names.

    A schema describes every key of a file and its unit. Programs that read results use the schemas of JSON files.
    TOML editors use the schemas of campaign, manifest and limits to complete and check keys while you type.

    With -o, writes <name>.schema.json; without NAME, writes the schemas of all files.
    """
    from bushfit.commands.schema import DESCRIBED, schema
    from bushfit.errors import error_location
    from bushfit.report.results import ResultFile

    with error_location(place="NAME"):
        schemas = {key: schema(key) for key in ([name] if name else DESCRIBED if output.output else ())}
    files = {key: described.files for key, described in DESCRIBED.items()}
    document: Mapping[str, Any] = schemas[name] if name else schemas or files
    if output.output:
        results = [ResultFile(f"{key}.schema", "json", content) for key, content in schemas.items()]
        output.write(output.output, results, document)
        return
    if name:
        output = replace(output, as_json=True, to_stderr=True)
        output.print(f"{name} describes: {files[name]}")
    else:
        output.print_table("schemas", ("name", "describes"), files.items(), text_columns=2)
    output.print_json(document)
