"""Formulas and units of the model as HTML with Greek letters, subscripts and exponents."""

import re

from markupsafe import Markup, escape

_GREEK = {
    **{"alpha": "α", "beta": "β", "delta": "δ", "eps": "ε", "eta": "η", "gamma": "γ", "mu": "μ", "omega": "ω"},
    **{"pi": "π", "sigma": "σ", "tau": "τ"},
}
_WORD = re.compile(rf"(?<![A-Za-z.])({'|'.join(_GREEK)})(?=$|[^A-Za-z])")
_SUBSCRIPT = re.compile(rf"(?<![\w.])({'|'.join(_GREEK)}|[A-Za-z])(?:_(\w+)|(\d)\b)")
_EXPONENT = re.compile(r"\^(\([^()]*\)|-?[\w./α-ω]+)")


def formula(text: str) -> Markup:
    """Convert an ASCII formula or unit to HTML: "m/2 (i omega)^alpha" becomes m/2 (i ω) with the exponent α."""
    html = str(escape(text))
    html = _SUBSCRIPT.sub(lambda match: f"{match[1]}<sub>{match[2] or match[3]}</sub>", html)
    html = _WORD.sub(lambda match: _GREEK[match[1]], html.replace("*", "·"))
    return Markup(_EXPONENT.sub(lambda match: f"<sup>{match[1].strip('()')}</sup>", html).replace("degC", "°C"))
