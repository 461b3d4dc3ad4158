"""Pages in a browser: nothing is asked for, nothing complained of, all can read them, and two sheets hold a report.

Where no Chromium is found, these tests are skipped, and say so.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import chromium
import pytest
from chromium import Tab

pytestmark = pytest.mark.skipif(
    chromium.found() is None, reason=f"none of {', '.join(chromium.NAMES)} is installed here"
)
Pages = Callable[[str], Path]
NAMES = ("cmp_15961", "mystery_mount", "measured", "two", "families", "batch", "production")
BOTH = [(name, width) for name in NAMES for width in (1280, 400)]
QUICK = [("mystery_mount", 1280), ("cmp_15961", 400)]


@pytest.fixture(scope="module")
def tab(tmp_path_factory) -> Iterator[Tab]:
    with chromium.tab(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def pages(results, request) -> Pages:
    def page(name: str) -> Path:
        if name in ("two", "families"):
            return Path(request.getfixturevalue("compared")) / name / "compare.html"
        if name == "production":
            return Path(request.getfixturevalue("made")) / "out/index.html"
        if name in ("measured", "batch"):
            file = {"measured": "report.html", "batch": "index.html"}[name]
            return Path(request.getfixturevalue(name)) / file
        return results(name) / "report.html"

    return page


@pytest.mark.parametrize(
    ("name", "width"),
    [pytest.param(name, width, marks=[] if (name, width) in QUICK else pytest.mark.slow) for name, width in BOTH],
)
def test_nothing_is_asked_for_and_all_can_read_it(tab, pages, name, width):
    """axe-core judges contrast, alternative texts, roles, tables and the rest."""
    page = pages(name)
    tab.open(page, width)
    assert tab.requests == [page.resolve().as_uri()]
    assert tab.complaints == []
    assert tab.run("document.documentElement.scrollWidth <= innerWidth"), "the page itself does not scroll sideways"
    tables = "[...document.querySelectorAll('.scroll:has(> table), .usable')]"
    cut = f"{tables}.filter(e => e.scrollWidth > e.clientWidth + 1).length"
    assert tab.run(cut) == 0, "the columns of all tables are whole"
    axe = pytest.importorskip("axe_core_python", reason="axe-core-python is not installed here")
    tab.run((Path(axe.__file__).parent / "axe.min.js").read_text(encoding="utf-8") + "; 0")
    told = "{bad: r.violations.map(v => v.id + ' ' + v.nodes[0].html), passes: r.passes.length}"
    found = tab.run(f"axe.run(document).then(r => ({told}))")
    print(f"{name} at {width}: {found['passes']} rules of axe-core hold")
    assert found["bad"] == []
    assert found["passes"] > 15


@pytest.mark.parametrize(
    "name", [NAMES[1], *(pytest.param(name, marks=pytest.mark.slow) for name in NAMES[:-2] if name != NAMES[1])]
)
def test_a_report_is_four_sheets_of_paper_at_most(tab, pages, name):
    tab.open(pages(name), 1280)
    assert tab.sheets() <= (3 if name in ("two", "families") else 4)


def test_values_are_shown_under_the_pointer(tab, pages):
    """At a measured point the values of this point, by the axes that the figure states."""
    tab.open(pages("cmp_15961"), 1280)
    hint = tab.run(
        """(() => {
          const svg = document.querySelector('#figures svg');
          const [left, , right, bottom] = JSON.parse(svg.dataset.axes)[0];
          const number = (e, name) => Number(e.getAttribute(name));
          const points = [...svg.querySelectorAll('use')].map(e => [number(e, 'x'), number(e, 'y')]);
          const [x, y] = points.find(([x, y]) => x > left + 1 && x < right && y < bottom - 1);
          const at = new DOMPoint(x, y).matrixTransform(svg.getScreenCTM());
          svg.dispatchEvent(new PointerEvent('pointermove', {clientX: at.x, clientY: at.y, bubbles: true}));
          return document.querySelector('.hint').textContent;
        })()"""
    )
    found = re.fullmatch(r"frequency \[Hz\] ([\d.]+), axial stiffness \|K\| \[N/mm\] ([\d.]+)", hint)
    assert found, hint
    assert float(found[1]) == pytest.approx(5.0, abs=0.6)
    assert float(found[2]) == pytest.approx(594, abs=2)


@pytest.mark.slow
def test_a_batch_is_sorted_by_its_headings(tab, pages):
    tab.open(pages("batch"), 1280)
    column = "[...document.querySelectorAll('.sorted tbody tr')].map(r => r.cells[0].textContent)"
    tab.run("document.querySelector('thead button').click()")
    assert tab.run(column) == ["=1+1 <b>", "c0", "c1", "c2"]
    tab.run("document.querySelector('thead button').click()")
    assert tab.run(column) == ["c2", "c1", "c0", "=1+1 <b>"]
    tab.run("[...document.querySelectorAll('thead button')].find(b => b.textContent.startsWith('mu')).click()")
    cells = "map(r => parseFloat(r.querySelector('td[align]').textContent))"
    mu = tab.run(f"[...document.querySelectorAll('.sorted tbody tr')].{cells}")
    assert mu[:3] == sorted(mu[:3])


@pytest.mark.slow
def test_rows_of_a_batch_are_filtered_and_all_are_printed(tab, pages):
    tab.open(pages("production"), 1280)
    tab.run(
        "(() => { const typed = document.querySelector('input[type=search]'); typed.value = 'ALPHA differs';"
        " typed.dispatchEvent(new Event('input')); })()"
    )
    rows = "[...document.querySelectorAll('.sorted tbody tr')]"
    shown = f"{rows}.filter(r => r.checkVisibility()).map(r => r.cells[0].textContent)"
    assert tab.run(shown) == ["part_07"]
    assert tab.run("document.querySelector('output').textContent") == "1 of 30"
    tab.ask("Emulation.setEmulatedMedia", media="print")
    assert len(tab.run(shown)) == 30
    tab.ask("Emulation.setEmulatedMedia", media="")


def test_without_style_and_script_nothing_is_lost(tab, pages, tmp_path):
    """As Jenkins shows it, whose content policy forbids both: https://www.jenkins.io/doc/book/security/configuring-content-security-policy"""
    policy = "sandbox; default-src 'none'; img-src 'self'; style-src 'self';"
    strict = re.sub(
        r'(http-equiv="Content-Security-Policy" content=")[^"]*',
        rf"\1{policy}",
        pages("mystery_mount").read_text(encoding="utf-8"),
    )
    (tmp_path / "strict.html").write_text(strict, encoding="utf-8")
    tab.open(tmp_path / "strict.html", 1280, scripts=False)
    assert any("style" in each for each in tab.complaints), "the policy is in force"
    tab.ask("Emulation.setScriptExecutionDisabled", value=False)
    assert tab.run("getComputedStyle(document.body).maxWidth") == "none"
    assert tab.run("[...document.querySelectorAll('svg')].every(e => e.getBoundingClientRect().width > 400)")
    assert tab.run("[...document.querySelectorAll('[hidden]')].length") == 0
    assert tab.run("document.documentElement.scrollWidth <= innerWidth")
    fill = "getComputedStyle(document.querySelector('#figures svg use[fill], #figures svg g[fill]')).fill"
    assert tab.run(fill) != "rgb(0, 0, 0)", "pictures keep their colours"
