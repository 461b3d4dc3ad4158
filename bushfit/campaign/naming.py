"""Names of folders: any text as a name that every operating system takes, and that leads nowhere else."""

from __future__ import annotations

import re

#: Characters that some system keeps for itself, and halves of surrogate pairs.
_UNSAFE_IN_FOLDERS = re.compile(r'[\x00-\x1f\x7f\ud800-\udfff/\\:*?"<>|]+')
#: Names that Windows keeps for devices, with any ending.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
#: Characters of a name: with the folders above it, a path stays within what Windows takes.
_LONGEST_FOLDER = 60


def folder_name(name: str) -> str:
    """A name as that of one folder: it never leads out of the folder it is put in, and is never empty."""
    safe = _UNSAFE_IN_FOLDERS.sub("_", name)[:_LONGEST_FOLDER].strip(" .") or "campaign"
    return f"_{safe}" if _DEVICES.fullmatch(safe) else safe
