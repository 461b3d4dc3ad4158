"""`bushfit schema`: what stands in the files, for other programs and for editors."""

from dataclasses import replace
from typing import Any

import click

from bushfit.cli.common import Options, with_options
from bushfit.cli.options import command_called, schemas
from bushfit.cli.show import tell_table


@command_called("schema", "", "model")
@click.argument("name", required=False, shell_complete=schemas)
@with_options("nothing is written")
def command(name: str | None, options: Options) -> None:
    """Print the JSON Schema (draft 2020-12) of NAME on standard output; without NAME, tell which there are.

    They say of every key what it holds and in which unit. Those of JSON files are for programs that read results; those
    of campaign, manifest and limits for editors of TOML, which then complete and check keys while you type.

    With -o, writes <name>.schema.json: that of NAME, or without NAME those of all files.
    """
    from bushfit.errors import error_location
    from bushfit.report.folder import to_json
    from bushfit.schemas import DESCRIBED, schema

    with error_location(place="NAME"):
        made = {each: schema(each) for each in ([name] if name else DESCRIBED if options.output else ())}
    document: dict[str, Any] = (
        made[name] if name else {**made} or {each: described.files for each, described in DESCRIBED.items()}
    )
    if options.output:
        files = {f"{each}.schema.json": to_json(found) for each, found in made.items()}
        options.write(options.output, files, document)
    elif name:
        options.say(f"{name} describes: {DESCRIBED[name].files}")
    else:
        rows = ((each, described.files) for each, described in DESCRIBED.items())
        tell_table(options, "schemas", ("name", "describes"), rows, names=2)
    if not options.output:
        replace(options, as_json=options.as_json or name is not None).print_json(document)
