"""Text files made from Jinja templates."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jinja2


@cache
def template_environment(folder: Path, *, is_markup: bool = False) -> jinja2.Environment:
    """Make the Jinja environment of the templates in a folder, which may import others by their paths in the package.

    Args:
        folder: folder of the templates.
        is_markup: True for HTML and XML, in which texts are escaped.

    Returns:
        Environment in which a missing variable is an error; cached.
    """
    import jinja2

    return jinja2.Environment(
        autoescape=is_markup,
        loader=jinja2.FileSystemLoader([folder, Path(__file__).parent]),
        keep_trailing_newline=True,
        lstrip_blocks=True,
        trim_blocks=True,
        undefined=jinja2.StrictUndefined,
    )


def render_template(file: Path, **values: Any) -> str:
    """Render a Jinja template of the package to the content of a file; the template of page.html is page.html.jinja.

    Args:
        file: template; texts are escaped if it makes XML.
        **values: variables of the template. `finalize`, if given, is a function that is applied to each value before it
            is written.

    Returns:
        Content of the file.
    """
    environment = template_environment(file.parent, is_markup=".xml" in file.suffixes)
    environment = environment.overlay(finalize=values.pop("finalize", None))
    return environment.get_template(file.name).render(values)
