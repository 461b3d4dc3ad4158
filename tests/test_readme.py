"""Stale documentation fails: every `$ bushfit ...` of every page and every example in Python runs, every link leads
somewhere."""

import doctest
import re
import shlex
import shutil
from itertools import chain
from pathlib import Path

import click
import pytest
from commandline import Done, Shared
from tries import some

from bushfit.cli import cli

ROOT = Path(__file__).parents[1]
#: Every page of the repository.
PAGES = sorted(
    page.relative_to(ROOT).as_posix()
    for page in chain(
        ROOT.glob("*.md"), *(ROOT.glob(f"{top}/**/*.md") for top in ("bushfit", "configs", "data", "tests"))
    )
)
CONSOLE = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(?:\S+/)?bushfit\b")
#: Numbers of the README and of a run agree within this: other processors round otherwise.
TOLERANCE = 0.03
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def examples(text: str) -> list[tuple[str, list[str]]]:
    """Each line after `$ ` of the console blocks, continued ones joined, and the output shown below it."""
    found: list[tuple[str, list[str]]] = []
    for block in CONSOLE.findall(text):
        for line in block.replace("\\\n", " ").splitlines():
            if line.startswith("$ "):
                found.append((line.removeprefix("$ ").strip(), []))
            elif line.strip() and line.strip() != "..." and "──" not in line:
                found[-1][1].append(line)
    return found


def says(line: str, output: str) -> bool:
    """Whether some line of the output is the line shown: the same words, numbers within TOLERANCE or a digit."""
    words, numbers = NUMBER.sub("#", line).split(), NUMBER.findall(line)
    return any(
        NUMBER.sub("#", other).split() == words
        and all(
            abs(float(mine) - float(shown)) <= TOLERANCE * abs(float(shown)) + 1.1 * 10.0 ** -max(2, _decimals(shown))
            for mine, shown in zip(NUMBER.findall(other), numbers, strict=True)
        )
        for other in output.splitlines()
    )


def _decimals(number: str) -> int:
    return len(number.partition("e")[0].partition(".")[2]) - int(number.partition("e")[2] or 0)


def test_blocks_are_understood():
    text = "a\n```console\n$ bushfit run \\\n    x.toml\n...\nwrote 1.5 it\n$ cd y\n```\n```python\n$ bushfit no\n```\n"
    (one, shown), (other, nothing) = examples(text)
    assert [shlex.split(one), shlex.split(other)] == [["bushfit", "run", "x.toml"], ["cd", "y"]]
    assert (shown, nothing) == (["wrote 1.5 it"], [])
    assert says(shown[0], "so\n wrote  1.51 it")
    assert not says(shown[0], "wrote 1.7 it")
    assert not says("within 0.0024", "within 0.0091")
    assert not says(shown[0], "wrote 1.5 them")
    assert Checker().check_output("a 1.00 b\n", "a  1.001 b\n", 0)
    assert not any(Checker().check_output("a 1.00 b\n", f"{said}\n", 0) for said in ("a 1.2 b", "a 1.00 b\nand more"))


def status(command: str) -> int:
    """The exit status that a command's comment tells, as in `# exit status 1: ...`; 0 where it tells none."""
    told = re.search(r"# exit status (\d)", command)
    return int(told[1]) if told else 0


def shown_commands(page: str) -> list[tuple[str, list[str]]]:
    """The `$ bushfit ...` of a page, each with the output shown."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [(command, shown) for command, shown in examples(text) if COMMAND.match(command)]


#: Commands of which some page shows that they draw.
DRAWING = {
    command
    for page in PAGES
    for command, shown in shown_commands(page)
    if re.search(r"\.(png|svg|pdf)\b", " ".join(shown))
}


def without_pictures(shared: Shared, folder: Path, command: str) -> Done:
    """In this process, once for all pages, and without pictures that no page speaks of: they take most of the time."""
    words = shlex.split(command, comments=True)[1:]
    known = cli.get_command(click.Context(cli), words[0])
    draws = known is not None and "no_plots" in {option.name for option in known.params}
    return shared.call(folder, *words, *["--no-plots"] * (draws and command not in DRAWING))


@pytest.mark.parametrize("page", some([page for page in PAGES if shown_commands(page)], ["README.md"]))
def test_every_command_of_a_page_runs_and_says_what_is_shown(page, shared, tmp_path):
    """In order, in a folder that holds the data and campaigns and nothing that another page has made."""
    for name in ("data", "configs"):
        shutil.copytree(ROOT / name, tmp_path / name)
    stale = []
    for command, shown in shown_commands(page):
        done = without_pictures(shared, tmp_path, command)
        print(f"$ {command} -> {done.returncode}")
        assert done.returncode == status(command), f"$ {command}\n{done.stderr}"
        stale += [f"$ {command}\n{line}" for line in shown if not says(line, done.stdout + done.stderr)]
    assert not stale, f"{page} shows what its commands do not say:\n" + "\n".join(stale)


class Checker(doctest.OutputChecker):
    """The words as they stand; numbers as near as other processors round."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        if super().check_output(want, got, optionflags):
            return True
        lines = want.splitlines(), got.splitlines()
        return len(lines[0]) == len(lines[1]) and all(map(says, *lines))


def test_every_example_of_the_page_on_python_runs_and_says_what_is_shown(root, tmp_path, monkeypatch):
    for name in ("configs", "data"):
        shutil.copytree(root / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    page = root / "bushfit/manual/python.md"
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    test = doctest.DocTestParser().get_doctest("".join(blocks), {}, "python.md", str(page), 0)
    said: list[str] = []
    runner = doctest.DocTestRunner(Checker(), optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    failed, tried = runner.run(test, out=said.append)
    print(f"{tried} examples")
    assert tried > 20
    assert failed == 0, "".join(said)


def anchors(page: Path) -> set[str]:
    """The anchors that a page's headings have where it is shown."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_and_names_of_files_lead_somewhere(page):
    """Files as seen from the top folder, where a page says where they are; patterns aside."""
    text = (ROOT / page).read_text(encoding="utf-8")
    lost = []
    for target, anchor in re.findall(r"\]\((?!https?://|mailto:)([^)#\s]*)(?:#([^)\s]+))?\)", text):
        place = (ROOT / page).parent / target if target else ROOT / page
        if not place.exists() or (anchor and anchor not in anchors(place)):
            lost.append(f"{target}#{anchor}")
    named = re.findall(r"`((?:configs|data|tests)/[\w/.]*|bushfit/[\w/]*(?:/|\.\w+))`", text)
    assert lost + [name for name in named if not (ROOT / name).exists()] == []


def test_the_readme_is_short(root):
    """At most 200 lines, and none that holds several; tables, pictures and output shown are as wide as they are."""
    text = (root / "README.md").read_text(encoding="utf-8")
    prose = re.sub(r"^```.*?^```|^(?:\||!\[).*?$", "", text, flags=re.MULTILINE | re.DOTALL)
    assert len(text.splitlines()) <= 200
    assert [line for line in prose.splitlines() if len(line) > 130] == []
