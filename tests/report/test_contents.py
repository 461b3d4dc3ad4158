"""Files in the forms that their reader wants: named before they are made, the same bytes each time."""

from __future__ import annotations

from typing import get_args
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from bushfit.reading.tablefile import Form
from bushfit.report.contents import Contents, Formats, Picture
from bushfit.report.plots.style import to_image

BEGINS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
#: A text with markup, the end of a comment, what mathematics would be, and letters that the font lacks.
NASTY = "<script>alert(1)</script> --> & $x_1$ 衬套"


def drawn() -> Figure:
    figure = Figure()
    figure.subplots().fill_between([1.0, 2.0], [1.0, 2.0], [2.0, 3.0], hatch="//")
    figure.suptitle(NASTY, parse_math=False)
    return figure


@pytest.mark.parametrize("form", get_args(Form))
@pytest.mark.parametrize("pictures", [("png",), ("svg", "pdf"), ()])
def test_files_have_the_names_told_before(form: Form, pictures: tuple[Picture, ...]) -> None:
    count = 0

    def picture() -> Figure:
        nonlocal count
        count += 1
        return drawn()

    formats = Formats(pictures=bool(pictures), table_form=form, picture_forms=pictures)
    table = pd.DataFrame({"x [mm]": np.ones(2)})
    contents = Contents({"model": {}}, {"a": lambda: table, "b": lambda: table}, {"b": picture})
    files = formats.files(contents)
    assert list(files) == formats.names(contents.kinds)
    end = "xlsx" if form == "xlsx" else "csv"
    assert list(files) == ["model.json", f"a.{end}", f"b.{end}", *(f"b.{each}" for each in pictures)]
    assert count == bool(pictures), "drawn once for all forms"
    for each in pictures:
        assert files[f"b.{each}"].startswith(BEGINS[each])


@pytest.mark.parametrize("form", get_args(Picture))
def test_a_picture_is_the_same_bytes_each_time_without_date_or_version(form: Picture) -> None:
    first, second = (to_image(drawn(), form) for _ in range(2))
    assert first == second
    assert not [word for word in (b"Matplotlib v", b"CreationDate", b"dc:date", b"Software") if word in first]


def test_an_svg_has_texts_as_outlines_and_no_element_of_theirs() -> None:
    tree = ElementTree.fromstring(to_image(drawn(), "svg"))
    names = {element.tag.partition("}")[2] for element in tree.iter()}
    assert {"path", "use"} <= names
    assert not {"script", "text", "image"} & names
