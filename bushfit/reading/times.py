"""Time of each row: clock times, dates, day numbers of spreadsheets, and rounded times."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from bushfit import units
from bushfit.reading.headers import WORDS
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import ALL_NUMERALS

if TYPE_CHECKING:
    from bushfit.reading.table import Table

#: Length of a day and of an hour [s].
DAY, HOUR = 86_400.0, 3600.0
#: Clock: 20:07:10.100, 07:10,5, 8:07:10 PM; a duration may follow "1 day, ".
_CLOCK = re.compile(
    r"(?:(?P<days>\d+) days?,?\s+)?(?:(?P<h>\d{1,4}):)?(?P<m>\d{1,4}):(?P<s>\d{1,2}(?:[.,:]\d+)?)"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
)
#: Date before a clock: 2026-11-26T, 26.11.2026, 11/26/2026, 26 11 2026.
_DATE = re.compile(r"(?P<a>\d{1,4})[-./\s]+(?P<b>\d{1,2})[-./,\s]+(?P<c>\d{1,4})(?:[T_\s,-]+|$)")
#: Date behind a clock: 20:07:10 26.11.2026.
_DATE_LAST = re.compile(r"(\d+:.+?)\s+(\d{1,4}[-./]\d{1,2}[-./]\d{2,4})")
#: Date and clock without separators, or with hyphens alone: 20261126 200710, 2026-11-26_20-07-10.
_COMPACT = re.compile(r"(\d{4})-?(\d\d)-?(\d\d)[T\s_-]?(\d\d)[-_]?(\d\d)[-_]?(\d\d)(?![\d:])")
#: Number of a month by the first three letters of its name.
_MONTHS = {word: number for number, words in enumerate(WORDS["dates"]["months"], start=1) for word in words.split()}
_MONTH = re.compile(rf"(?<![^\W\d])({'|'.join(_MONTHS)})[^\W\d]*\.?", re.IGNORECASE)
#: Time zone after a clock.
_ZONE = re.compile(r"\s*(?:Z|UTC|GMT|[+-]\d\d:?\d\d)$")
#: Day numbers of spreadsheets from 1954 to 2119; chosen: all dates of tests.
_DAY_NUMBERS = (20_000.0, 80_000.0)
#: Largest mean step of day numbers [d]; chosen: rows follow each other within 9 s.
_LARGEST_DAY_STEP = 1e-4


def parse_clock(text: str) -> float | None:
    """Parse a clock time such as "20:07:10.1", with or without a date before it.

    In 07:10:100 the last part is milliseconds. Days and months that are ambiguous are read as day and month; only the
    differences between rows are used.

    Returns:
        Time since midnight, or since 1970 if the text has a date [s]; None if the text is not a time.
    """
    text = _COMPACT.sub(r"\1-\2-\3 \4:\5:\6", _ZONE.sub("", text.strip()))
    text = _MONTH.sub(lambda month: str(_MONTHS[month[1].lower()]), text)
    text = _DATE_LAST.sub(r"\2 \1", text)
    date, days = _DATE.match(text), 0.0
    if date:
        first, second, third = (int(part) for part in date.groups())
        year, month, day = (first, second, third) if first > 31 else (third, second, first)
        month, day = (day, month) if month > 12 else (month, day)
        try:
            days = (datetime(year if year > 99 else 2000 + year, month, day) - datetime(1970, 1, 1)) / timedelta(days=1)
        except ValueError:
            return None
        text = text[date.end() :]
        if not text:
            return None
    match = _CLOCK.fullmatch(text)
    if match is None:
        return None
    hours, half = int(match["h"] or 0), (match["half"] or "").lower()
    if half:
        hours = hours % 12 + 12 * half.startswith("p")
    whole, _, rest = re.sub("[,:]", ".", match["s"]).partition(".")
    days += int(match["days"] or 0)
    return DAY * days + HOUR * hours + 60.0 * int(match["m"]) + int(whole) + (float(f"0.{rest}") if rest else 0.0)


def are_day_numbers(values: Floats) -> bool:
    """Return True if numbers, (n,), look like dates of a spreadsheet in days: from 1954 to 2119, and seconds apart.

    As seconds, the same numbers would be a record with steps below 0.1 ms that begins hours after zero.
    """
    low, high = _DAY_NUMBERS
    in_range = values.size > 1 and low <= float(values.min()) and float(values.max()) <= high
    return in_range and 0.0 < float(np.ptp(values)) < _LARGEST_DAY_STEP * values.size


def spread_rounded_times(time: Floats) -> Floats | None:
    """Replace recorded times [s], (n,), that were rounded, so that values repeat, by evenly spaced times.

    Returns:
        Times [s], (n,); None if time decreases, or if no even sampling rounds to these times.

    Notes:
        With q the smallest step between different times, an even clock t0 + i dt is rounded to within q. The line
        through the first rows of each value gives t0 and dt.
    """
    steps = np.diff(time)
    if steps.min(initial=1.0) < 0.0 or not np.any(steps > 0.0):
        return None
    first = np.append(0, np.flatnonzero(steps > 0.0) + 1)
    if first.size < 3:
        return None
    quantum = float(steps[steps > 0.0].min())
    row = np.arange(time.size)
    slope, start = np.polyfit(first[1:], time[first[1:]], 1)
    even = start + slope * row
    return even - even[0] + time[0] if np.all(np.abs(even - time) <= 1.01 * quantum) else None


def sampling_rate_above(table: Table) -> tuple[float | None, str]:
    """Find the sampling rate that a line above a table states clearly, in the notation of its numbers.

    Returns:
        Sampling rate [Hz], and a sentence for a table without a time column; None and "" if no line states it.
    """
    text, _, unit = (table.labels_above.sampling or "").partition(" ")
    values = {way.value(text) for way in ALL_NUMERALS} - {None}
    value = values.pop() if len(values) == 1 else table.numerals.value(text) if text else None
    if not value:
        return None, ""
    is_rate = units.is_compatible(unit, "Hz")
    rate = value * units.si_factor(unit, "Hz") if is_rate else 1.0 / (value * units.si_factor(unit, "s"))
    return rate, f"no time column: the rows are {rate:.6g} a second, as the lines above the table state"
