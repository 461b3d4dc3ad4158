"""bushfit: fit and diagnose the frequency- and amplitude-dependent stiffness of rubber bushings.

Numbers are in SI: Hz, m, rad, N/m, and shares such as 0.01. Each function does what the command of its name does.
"""

from __future__ import annotations

from bushfit.version import __version__ as __version__

TYPE_CHECKING = False  # type checkers take it for true; importing typing takes as long as all the rest
if TYPE_CHECKING:
    from typing import Any

    from bushfit.campaign.campaign import load_campaign
    from bushfit.commands.compare import compare
    from bushfit.commands.diagnose import diagnose
    from bushfit.commands.fit import fit, fit_dynamic, fit_static
    from bushfit.commands.loading import load_model
    from bushfit.commands.predict import predict
    from bushfit.commands.respond import respond
    from bushfit.commands.results import parameters, picture, save, table
    from bushfit.commands.run import run
    from bushfit.commands.simulate import simulate

__all__ = [
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
    "respond",
    "run",
    "save",
    "simulate",
    "table",
]
#: Module of each function that is not in the module of its name below bushfit.commands.
_MODULES = {
    "fit_dynamic": "commands.fit",
    "fit_static": "commands.fit",
    "load_campaign": "campaign.campaign",
    "load_model": "commands.loading",
    **dict.fromkeys(("parameters", "picture", "save", "table"), "commands.results"),
}


def __getattr__(name: str) -> Any:
    """Import a public function when it is first used, because importing all of them takes a second."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"bushfit.{_MODULES.get(name, f'commands.{name}')}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
