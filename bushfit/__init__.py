"""bushfit: fit and diagnose the frequency- and amplitude-dependent stiffness of rubber bushings.

Numbers are in SI: Hz, m, rad, N/m, and shares such as 0.01. Each function does what the command of its name does.
"""

from __future__ import annotations

from bushfit.version import __version__ as __version__

TYPE_CHECKING = False  # type checkers take it for true; importing typing takes as long as all the rest
if TYPE_CHECKING:
    from typing import Any

    from bushfit.campaign.campaign import load_campaign as load_campaign
    from bushfit.commands.compare import compare as compare
    from bushfit.commands.diagnose import diagnose as diagnose
    from bushfit.commands.fit import fit as fit
    from bushfit.commands.fit import fit_dynamic as fit_dynamic
    from bushfit.commands.fit import fit_static as fit_static
    from bushfit.commands.loading import load_model as load_model
    from bushfit.commands.predict import predict as predict
    from bushfit.commands.respond import respond as respond
    from bushfit.commands.results import parameters as parameters
    from bushfit.commands.results import picture as picture
    from bushfit.commands.results import save as save
    from bushfit.commands.results import table as table
    from bushfit.commands.run import run as run
    from bushfit.commands.simulate import simulate as simulate

#: Module of each public function.
_MODULES = {
    **{name: f"commands.{name}" for name in ("compare", "diagnose", "fit", "predict", "respond", "run", "simulate")},
    **dict.fromkeys(("fit_dynamic", "fit_static"), "commands.fit"),
    **dict.fromkeys(("parameters", "picture", "save", "table"), "commands.results"),
    **{"load_campaign": "campaign.campaign", "load_model": "commands.loading"},
}
__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    """Import a public function when it is first used, because importing all of them takes a second.

    While the function runs, linear algebra uses one thread, as in the commands: several threads take several times as
    long for small matrices.
    """
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    from threadpoolctl import threadpool_limits

    function = threadpool_limits.wrap(limits=1)(getattr(import_module(f"bushfit.{_MODULES[name]}"), name))
    function.__module__ = __name__  # where pickle finds it
    return globals().setdefault(name, function)


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
