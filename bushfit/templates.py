"""Text files made from Jinja templates."""

from pathlib import Path
from typing import Any


def render_template(file: Path, **values: Any) -> str:
    """Render a template, whose name is that of the rendered file with the further extension `.jinja`.

    Args:
        file: template; texts are escaped if it makes XML.
        **values: variables of the template. `finalize`, if given, is a function that is applied to each value before it
            is written.

    Returns:
        Content of the file.
    """
    import jinja2

    environment = jinja2.Environment(
        autoescape=".xml" in file.suffixes,
        finalize=values.pop("finalize", None),
        keep_trailing_newline=True,
        lstrip_blocks=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.from_string(file.read_text(encoding="utf-8")).render(values)
