"""bushfit: fit and question the frequency- and amplitude-dependent stiffness of rubber bushings."""

from __future__ import annotations

from bushfit.version import __version__ as __version__

TYPE_CHECKING = False  # as type checkers take it for true; to import typing takes as long as all the rest
if TYPE_CHECKING:
    from typing import Any

    from bushfit.api import *  # noqa: F403

__all__ = [  # noqa: F405
    "compare",
    "diagnose",
    "fit",
    "fit_dynamic",
    "fit_static",
    "load_campaign",
    "load_model",
    "parameters",
    "picture",
    "predict",
    "run",
    "save",
    "simulate",
    "table",
]


def __getattr__(name: str) -> Any:
    """The functions of `bushfit.api`, imported when the first is asked for, because that takes a second."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module("bushfit.api"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
