"""Result files: content, file formats, and writing into a results folder.

A results folder is a plain folder. Each file is written under a temporary name in the same folder and then moved over
its predecessor, so that a killed command leaves each file either old or new, never incomplete. Nothing else in the
folder changes. bushfit replaces a file only if the record `.bushfit.sha256` of the folder lists its present content.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bushfit.errors import CONTROL, OutputError
from bushfit.progress import track
from bushfit.reading.tablefile import Form, ending, folder_name, to_bytes
from bushfit.report import plots

if TYPE_CHECKING:
    from bushfit.geometry import Place
    from bushfit.report.plots.style import Chart

#: File formats of a figure.
Picture = Literal["png", "svg", "pdf"]
#: Kinds of result file in the order of writing: numbers first, so that a figure that fails does not lose them.
Kind = Literal["json", "raw", "table", "page", "figure"]
_KINDS: tuple[Kind, ...] = ("json", "raw", "table", "page", "figure")
#: Record of the files that bushfit wrote into a folder: lines of SHA-256 and file name, in the format of sha256sum.
_RECORD = ".bushfit.sha256"
#: Control characters, other than line ends, that are escaped in a JSON document.
_CONTROL_CHARACTERS = re.compile(rf"(?!\n){CONTROL.pattern}")


class ResultFile:
    """One file of a result, whose content is computed when it is first needed.

    Args:
        name: file name without its extension; a raw file has its extension.
        kind: "json", "table", "figure", "page" (HTML) or "raw".
        content: content, or function that makes it: a mapping, a pandas table, a chart, HTML text or bytes, by kind.

    Attributes:
        content: function that returns the content; it computes the content once.
    """

    def __init__(self, name: str, kind: Kind, content: Any) -> None:
        self.name, self.kind = name, kind
        self.content: Callable[[], Any] = cache(content if callable(content) else lambda: content)


def place_names(places: Iterable[Place]) -> list[str]:
    """Unique file names, without extension, for the results of directions and specimens; valid on every system."""
    names: list[str] = []
    for place in places:
        name = folder_name(str(place))
        is_taken = name.casefold() in map(str.casefold, names)
        names.append(f"{name}_{len(names) + 1}" if is_taken else name)
    return names


@dataclass(frozen=True)
class Formats:
    """File formats of tables and figures, and the kinds of result file to omit.

    Args:
        tables, pictures, pages: True to write files of this kind.
        table_form: "csv", "decimal-comma" (CSV for German Excel) or "xlsx".
        picture_forms: one or more of "png", "svg" and "pdf".
    """

    tables: bool = True
    pictures: bool = True
    pages: bool = True
    table_form: Form = "csv"
    picture_forms: tuple[Picture, ...] = ("png",)

    def table(self, name: str) -> str:
        """File name, with extension, of the table `name`."""
        return f"{name}.{ending(self.table_form)}"

    def encoders(self, file: ResultFile) -> dict[str, Callable[[Any], bytes]]:
        """Names of the files on disk that a result file is written to, and functions that encode its content.

        Returns:
            Functions by file name with extension: one for each picture format of a figure; none if the kind is omitted.
        """
        name, tables = file.name, {self.table(file.name): partial(to_bytes, file.name, form=self.table_form)}
        # the module for images imports matplotlib, which is slow
        draw: Callable[[Picture, Chart], bytes] = lambda form, chart: plots.style.to_image(chart, form)  # noqa: E731
        figures = {f"{name}.{form}": partial(draw, form) for form in self.picture_forms}
        encoders: dict[Kind, Mapping[str, Callable[[Any], bytes]]] = {
            "json": {f"{name}.json": to_json},
            "raw": {name: bytes},
            "table": tables if self.tables else {},
            "page": {f"{name}.html": str.encode} if self.pages else {},
            "figure": figures if self.pictures else {},
        }
        return dict(encoders[file.kind])


def encode_all(files: Iterable[ResultFile], formats: Formats) -> dict[str, bytes]:
    """Encode all files of a result: bytes by file name with extension; a table that is too large is an OutputError."""
    return {name: encode(file.content()) for file in files for name, encode in formats.encoders(file).items()}


def to_json(document: Mapping[str, Any]) -> bytes:
    """Encode a document as JSON in UTF-8, with control characters escaped so that it is safe to print in a terminal."""
    text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
    return (_CONTROL_CHARACTERS.sub(lambda sign: f"\\u{ord(sign[0]):04x}", text) + "\n").encode()


def write_results(
    folder: Path,
    files: Iterable[ResultFile],
    formats: Formats | None = None,
    *,
    overwrite: bool = False,
    inputs: Iterable[Path] = (),
) -> list[str]:
    """Write the files of a result into a folder.

    Numbers are written first and figures last: if a figure fails, all other files are complete.

    Args:
        folder: results folder, made if it does not exist.
        files: files of the result.
        formats: formats to write, and kinds to omit; None for the defaults of `Formats`.
        overwrite: True to replace files of an earlier result.
        inputs: files that the run has read; they are not replaced.

    Returns:
        Names of the files written, in the order of writing.

    Raises:
        OutputError: the folder cannot be written, or holds a file that must not be replaced.
    """
    formats = formats or Formats()
    written = [file for file in files if formats.encoders(file)]
    ordered = sorted(written, key=lambda file: _KINDS.index(file.kind))
    names = [name for file in ordered for name in formats.encoders(file)]
    check_free(folder, names, overwrite=overwrite, inputs=inputs)
    for file in track("files made", ordered):
        write_files(folder, encode_all([file], formats))
    return names


def write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files, given as bytes by name, into a folder; each is complete or keeps its earlier content.

    Raises:
        OutputError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in contents.items():
            part = folder / f".{uuid.uuid4().hex}.part"
            try:
                with part.open("xb") as stream:
                    stream.write(content)
                    stream.flush()
                    os.fsync(stream.fileno())
                with (folder / _RECORD).open("ab") as record:  # before the move: the record lists every file
                    record.write(f"{hashlib.sha256(content).hexdigest()}  {name}\n".encode())
                part.replace(folder / name)
            finally:
                part.unlink(missing_ok=True)
    except OSError as error:
        with suppress(OSError):  # remove the folder if it is still empty
            folder.rmdir()
        raise unwritable_error(folder, error) from error


def check_free(folder: Path, names: Sequence[str], *, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Check that files with the given names may be written into a folder, without writing anything.

    Args:
        folder: results folder, which need not exist.
        names: names of the files to write.
        overwrite: True if files of an earlier result may be replaced.
        inputs: files that the run reads.

    Raises:
        OutputError: the folder is a file or not writable; or one of the names belongs to a folder, an input, a file
            that bushfit did not write or, unless `overwrite` is True, a file of an earlier result.
    """
    elsewhere = "name another folder with -o/--output"
    try:
        if folder.exists() and not folder.is_dir():
            raise OutputError("the output is not a folder", file=folder, hint="name another -o/--output")
        nearest = next(path for path in (folder.absolute(), *folder.absolute().parents) if os.path.lexists(path))
        if not nearest.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "Not a directory", str(nearest))
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "no permission to write there", str(nearest))
        existing, read = dict[str, str](), [file for file in inputs if file.exists()]
        # digests before the record: a command that runs now records its files, then moves them here
        for name in (name for name in names if os.path.lexists(folder / name)):
            file, hint = folder / name, f"move it away, or {elsewhere}"
            if file.is_dir():
                raise OutputError("a folder has the name of a result file", file=file, hint=hint)
            if file.exists() and any(file.samefile(path) for path in read):
                raise OutputError("a result would replace an input of this run", file=file, hint=elsewhere)
            is_plain = file.is_file() and not file.is_symlink()
            existing[name] = hashlib.sha256(file.read_bytes()).hexdigest() if is_plain else ""
        record = folder / _RECORD
        recorded = record.read_text(encoding="utf-8", errors="replace").splitlines() if record.exists() else []
        foreign = [name for name, digest in existing.items() if f"{digest}  {name}" not in recorded]
    except OSError as error:
        raise unwritable_error(folder, error) from error
    if foreign:
        raise OutputError(
            "a result would replace a file that bushfit did not write, or that was changed",
            file=folder if folder.name else None,
            found=", ".join(foreign),
            hint=f"move it away, or {elsewhere}",
        )
    if existing and not overwrite:
        raise OutputError(
            "there are results already",
            file=folder if folder.name else None,
            found=", ".join(existing),
            hint="--force replaces them; -o/--output writes elsewhere",
        )


def unwritable_error(folder: Path, error: OSError) -> OutputError:
    """Make the error for a results folder that cannot be written."""
    return OutputError(
        "the results cannot be written",
        file=folder,
        found=error.strerror or str(error),
        hint="free some space, get permission, or name another folder with -o/--output",
    )
