"""What a score card writes, key by key; its outcomes go to disk a line each as they come, so that a run that is stopped
goes on where it was."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError
from typing_extensions import TypedDict

from bushfit.errors import OutputError
from bushfit.report import disk
from cards.card import Row
from cards.families import Family
from cards.outcome import Outcome, Task

#: File of the outcomes: what was asked for on the first line, then an outcome a line.
LEDGER = "outcomes.jsonl"

_LINES = TypeAdapter(Outcome)


class Asked(TypedDict):
    """What a score card is made of: the first line of outcomes.jsonl, and part of scorecard.json.

    Args:
        schema: of this file.
        version: of bushfit that made it.
        families: of hidden campaigns.
        campaigns: how many of each family.
        seed: of everything random.
        session: hours of the session that is planned, and simulated, where effects are left open; null for none.
    """

    schema: Literal["bushfit/scorecard/2"]
    version: str
    families: list[str]
    campaigns: int
    seed: int
    session: float | None


class Scorecard(Asked):
    """How often diagnose is right on hidden campaigns.

    Args:
        card: the measures of each family, with their targets.
        confusion: of each family: by what was hidden, how often which verdict with which names was given.
        outcomes: every campaign.
    """

    card: dict[Family, list[Row]]
    confusion: dict[Family, dict[str, dict[str, int]]]
    outcomes: list[Outcome]


@contextmanager
def ledger(
    folder: Path | None, asked: Mapping[str, Any], *, force: bool
) -> Iterator[tuple[dict[Task, Outcome], Callable[[Outcome], None]]]:
    """The outcomes that stand in a folder, by task, and what writes one more down.

    A line that a killed run left half written is cut off.

    Args:
        folder: made where it is not there; nothing stands or is written where it is None.
        asked: what the card is made of; a folder holds the outcomes of one card.
        force: begin anew, whatever stands there.

    Raises:
        OutputError: another run is at work there, the outcomes there are those of another card, or are no outcomes.
    """
    if folder is None:
        yield {}, lambda _: None
        return
    file, first = folder / LEDGER, json.dumps(asked).encode() + b"\n"
    folder.mkdir(parents=True, exist_ok=True)
    file.touch()
    try:
        claim = disk.claim(file, wait=False)
    except BlockingIOError:
        hint = "wait for its end, or name another folder with -o"
        raise OutputError("another score card is made there", file=folder, hint=hint) from None
    with closing(claim):
        written = b"" if force else file.read_bytes()
        whole = written[: written.rfind(b"\n") + 1]
        done = _read(file, first, whole) if whole else {}
        with file.open("r+b", buffering=0) as stream:
            stream.seek(len(whole))
            stream.truncate()

            def write(line: bytes) -> None:
                stream.write(line)

            write(b"" if whole else first)
            yield done, lambda outcome: write(_LINES.dump_json(outcome) + b"\n")


def _read(file: Path, first: bytes, whole: bytes) -> dict[Task, Outcome]:
    lines = whole.splitlines(keepends=True)
    if lines[0] != first:
        raise OutputError(
            "outcomes of another card stand there",
            file=file,
            found=lines[0].decode(errors="replace").strip(),
            expected=first.decode().strip(),
            hint="the same options go on with it, --force begins anew, -o names another folder",
        )
    found: dict[Task, Outcome] = {}
    for number, line in enumerate(lines[1:], start=2):
        try:
            outcome = _LINES.validate_json(line)
        except ValidationError as error:
            raise OutputError(
                "a line is no outcome of a score card",
                file=file,
                place=f"line {number}",
                found=line[:60].decode(errors="replace").strip(),
                hint="take the line out, and its campaign is made again; or begin anew with --force",
            ) from error
        found[outcome.task] = outcome
    return found
