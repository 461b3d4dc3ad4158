"""Questions to a person at a terminal: what neither a file nor an option says, each answer checked at once."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import click

from bushfit.cli.common import Options
from bushfit.cli.file_options import STATED, TYPES
from bushfit.cli.options import option_of
from bushfit.errors import BushfitError

#: An option that the hint of an error names, perhaps with the role of a column.
_NAMED = re.compile(r'--(?:(column|unit) "?(\w+)=|([a-z][a-z-]+))')
#: How a question is put, by the key that its answer is of, or else by the key itself.
_WORDS = {
    "column": "header of the column of the {role}",
    "unit": "unit of the {role}",
    "rate": 'rate of the motion, such as "10 mm/min", or its frequency, such as "0.1 Hz"',
    "waveform": "course of the motion in time",
    "amplitude": "they count",
    "at_amplitude": 'its amplitude, such as "0.1 mm"',
    "at_frequency": 'its frequency, such as "10 Hz"',
    "temperature": 'its temperature, such as "23 degC"',
    "preload": 'preload of these tests, such as "500 N axial" or "none"; Enter leaves it open',
    "inner_diameter": 'inner diameter of the rubber, where it meets the inner sleeve, such as "20 mm"',
    "outer_diameter": 'its outer diameter, such as "36 mm"',
    "length": 'its length, the mean of inside and outside, such as "34 mm"',
}
#: The key that an answer is of, and of columns and units the role.
_Key = tuple[str, str]
#: What is asked for once for all files, with what is offered.
_ONCE: dict[_Key, str] = {("amplitude", ""): "zero-to-peak", ("preload", ""): ""}
_Seen = TypeVar("_Seen")


@dataclass(frozen=True)
class Questions:
    """Questions of one command, where somebody is `asked`; the last answer to one is offered when it comes again."""

    options: Options
    asked: bool
    _answers: dict[_Key, Any] = field(default_factory=lambda: dict.fromkeys(_ONCE))

    @classmethod
    def of(cls, options: Options, *, no_input: bool) -> Questions:
        """Those of a command, none where nobody is there to answer, or wants to be asked."""
        asked = not (no_input or options.quiet or options.as_json) and sys.stdin is not None and sys.stdin.isatty()
        return cls(options, asked)

    def settled(self, stated: Mapping[str, Any], look: Callable[[Mapping[str, Any]], _Seen]) -> _Seen:
        """What comes of what is stated, with answers to what the errors of that ask for."""
        given: dict[_Key, Any] = {}
        while True:
            try:
                return look(_together(stated, given))
            except BushfitError as error:
                if not self.asked:
                    raise
                told = type(error)(**{**vars(error), "hint": None})
                wanted = _wanted(error)
                new = [key for key in wanted if key not in given and not stated.get(key[0])]
                wrong = [key for key, answer in given.items() if key in wanted or _is_about(told, key, answer)]
                if not (new or wrong):
                    raise
                for key in [] if new else [*given][[*given].index(wrong[0]) :]:  # and what was asked for after it
                    del given[key], self._answers[key]
                given |= self._answer((new or wrong)[0], told)

    def _answer(self, key: _Key, told: BushfitError) -> dict[_Key, Any]:
        name, role = key
        known = self._answers.get(key)
        if key not in _ONCE or known is None:
            self.options.say(f"\n{told}")
            words = _WORDS.get(name, name.replace("_", " ")).format(role=role.replace("_", " "))
            usual = _ONCE.get(key, known)
            known = click.prompt(words, default=usual, type=TYPES.get(name), show_default=usual != "", err=True)
            key = ("frequency", "") if name == "rate" and "Hz" in known else key
        self._answers[key] = known
        return {key: known}


def _together(stated: Mapping[str, Any], given: Mapping[_Key, Any]) -> dict[str, Any]:
    """What is stated of a test, and the answers."""
    every = dict(stated)
    for (name, role), answer in given.items():
        every |= {f"{name}s": {**every.get(f"{name}s", {}), role: answer}} if role else {name: answer}
    return every


def _wanted(error: BushfitError) -> list[_Key]:
    """What an error asks for, a column last: that a file has one is seldom not known to bushfit."""
    found = [(kind or option.replace("-", "_"), role) for kind, role, option in _NAMED.findall(error.hint or "")]
    known = [(name, role) for name, role in found if role or name in STATED or name in _WORDS]
    return sorted(known, key=lambda key: key[0] == "column")


def _is_about(error: BushfitError, key: _Key, answer: Any) -> bool:
    """Whether an error tells of an answer."""
    place, quoted = option_of(key[0]) in (error.place or ""), f'"{answer}"' in error.problem
    return place or quoted or (error.found or "").strip('"') == str(answer)
