"""Text files made from Jinja templates."""

from pathlib import Path
from typing import Any


def render_template(file: Path, **values: Any) -> str:
    """Render a Jinja template of the package to the content of a file; the template of page.html is page.html.jinja.

    Args:
        file: template, which may import others by their paths in the package; texts are escaped if it makes XML.
        **values: variables of the template. `finalize`, if given, is a function that is applied to each value before it
            is written.

    Returns:
        Content of the file.
    """
    import jinja2

    package = Path(__file__).parent
    environment = jinja2.Environment(
        autoescape=".xml" in file.suffixes,
        loader=jinja2.FileSystemLoader(package),
        finalize=values.pop("finalize", None),
        keep_trailing_newline=True,
        lstrip_blocks=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(file.relative_to(package).as_posix()).render(values)
