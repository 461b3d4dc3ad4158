"""Small damage to a table or a model file."""

from collections.abc import Callable
from typing import Any

Lines = Callable[[list[str]], "str | bytes | None"]


def text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def row(number: int, old: str, new: str) -> Lines:
    """A text replaced in one line, counted from 1."""

    def change(lines: list[str]) -> str:
        assert old in lines[number - 1], lines[number - 1]
        return text([*lines[: number - 1], lines[number - 1].replace(old, new, 1), *lines[number:]])

    return change


def every(old: str, new: str) -> Lines:
    return lambda lines: text(lines).replace(old, new)


def kept(count: int) -> Lines:
    return lambda lines: text(lines[:count])


def column(index: int, value: str) -> Lines:
    """One column, all of one value."""

    def change(lines: list[str]) -> str:
        rows = [line.split(",") for line in lines[1:]]
        return text([lines[0], *(",".join([*cells[:index], value, *cells[index + 1 :]]) for cells in rows)])

    return change


def added(header: str, *values: str) -> Lines:
    """One column more, of values that take turns."""
    return lambda lines: text(
        [f"{lines[0]},{header}", *(f"{line},{values[index % len(values)]}" for index, line in enumerate(lines[1:]))]
    )


def wide(old: str, new: str) -> Lines:
    """The sweep as a wide table, with a text replaced."""

    def change(lines: list[str]) -> str:
        cells = [line.split(",") for line in lines[1:]]
        levels = list(dict.fromkeys(row[1] for row in cells))
        blocks = []
        for title, column in (("K* [N/mm]", 2), ("tan delta", 3)):
            by_frequency: dict[str, list[str]] = {}
            for row in cells:
                by_frequency.setdefault(row[0], []).append(row[column])
            rows = [",".join([frequency, *values]) for frequency, values in by_frequency.items()]
            blocks += [title, ",".join(["f [Hz]", *(f"{level} mm" for level in levels)]), *rows]
        content = text(blocks)
        assert old in content, content
        return content.replace(old, new, 1)

    return change


def entry(*path: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    """One entry of the model file set."""

    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return change


def without(*path: str | int) -> Callable[[dict[str, Any]], None]:
    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        del document[path[-1]]

    return change
