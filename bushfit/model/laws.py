"""Effects from outside the package that a campaign or a model file names: a trusted Python file, or a package."""

import hashlib
import os
from pathlib import Path
from types import ModuleType

from bushfit.caveat import Caveat
from bushfit.effects import ORIGINS, Origin, register
from bushfit.errors import ModelError
from bushfit.reading.files import read_utf8

#: Environment variable that permits to run the Python files of campaigns and models if it is "1"; `--trust` sets it.
TRUST = "BUSHFIT_TRUST"
#: Maximum size of a Python file [bytes].
_LARGEST_BYTES = 1_000_000


def register_file(file: Path, sha256: str = "") -> None:
    """Run a Python file and add its effect, named after the file, to the library.

    Args:
        file: Python file with the record and the functions of the effect.
        sha256: SHA-256 that the file must have; empty for any.

    Raises:
        ModelError: no permission to run the file, the file is missing or has changed, or its effect is not valid.
    """
    content = read_utf8(file, ModelError, largest=_LARGEST_BYTES, hint="give the Python file of an effect")
    origin = Origin(file=str(file), sha256=hashlib.sha256(content).hexdigest())
    if sha256 not in ("", origin.sha256):
        hint = "fit the campaign again, or restore the file"
        raise ModelError("the file of the effect has changed since the model was fitted", found=str(file), hint=hint)
    if ORIGINS.get(file.stem) == origin:
        return
    if os.environ.get(TRUST) != "1":
        raise ModelError(
            "the effect is Python code, which bushfit runs only with your permission",
            found=str(file),
            expected="--trust in the command",
            hint="read the file first: its code can do whatever you can do on this computer",
        )
    law = ModuleType(file.stem)
    try:
        exec(compile(content, str(file), "exec"), vars(law))
    except Exception as error:  # whatever the user's code raises
        raise ModelError("the law cannot be run", found=f"{file}: {error} ({type(error).__name__})") from error
    register(file.stem, law, origin)


def require_effect(name: str, origin: Origin) -> Caveat | None:
    """Make an effect from outside the package available that a model file uses.

    Args:
        name: name of the effect.
        origin: origin of the effect when the model was fitted.

    Returns:
        Warning if another version of the package is installed; otherwise None.

    Raises:
        ModelError: the package is not installed, or the file cannot be used.
    """
    if origin.file:
        register_file(Path(origin.file), origin.sha256)
    elif name not in ORIGINS:
        raise ModelError(
            "the model has an effect from another package",
            place=name,
            found="the package is not installed",
            expected=str(origin),
            hint=f"install {origin.package} in the environment of bushfit",
        )
    elif ORIGINS[name] != origin:
        sentence = f"the model was fitted with the law of {origin}, and {ORIGINS[name]} is installed"
        return Caveat("other_law", sentence).about(name)
    return None
