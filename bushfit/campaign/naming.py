"""Names of folders: any text as the name of one folder that every operating system takes."""

import re

#: Characters that some operating system does not allow in a name, and halves of surrogate pairs.
_UNSAFE_IN_FOLDERS = re.compile(r'[\x00-\x1f\x7f\ud800-\udfff/\\:*?"<>|]+')
#: Names that Windows keeps for devices, with any ending.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def folder_name(name: str) -> str:
    """A text as the name of one folder; it is never empty, and never leads out of the folder that it is put in.

    It has 60 characters at most: with the folders above it, a path stays below the 260 that Windows takes.
    """
    safe = _UNSAFE_IN_FOLDERS.sub("_", name)[:60].strip(" .") or "campaign"
    return f"_{safe}" if _DEVICES.fullmatch(safe) else safe
