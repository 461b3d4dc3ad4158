"""A report for continuous integration: a test case a bushing."""

from junitparser import Error, Failure, JUnitXml, TestCase, TestSuite

from bushfit.batch.document import Record
from bushfit.batch.limits import Judgement
from bushfit.batch.manifest import Row


class Report:
    """Grows by a case a bushing: an error where the row failed, a failure where it misses limits, else a pass."""

    def __init__(self, name: str) -> None:
        self._suite = TestSuite(name)

    def add(self, row: Row, record: Record, judged: Judgement | None) -> None:
        case = TestCase(_printable(row.name), self._suite.name, record["seconds"])
        failed, missed = record["status"] != "done", judged.missed if judged else {}
        if failed or missed:
            text = _printable(record["error"] if failed else "\n".join(missed.values()))
            line = text.partition("\n")[0] if failed else "; ".join(text.splitlines())
            result = Error(line, "failed") if failed else Failure(line, "limits")
            result.text = text
            case.result = [result]
        self._suite.add_testcase(case)

    def to_xml(self) -> bytes:
        report = JUnitXml("bushfit batch")
        report.add_testsuite(self._suite)
        report.update_statistics()  # type: ignore[no-untyped-call]
        return b'<?xml version="1.0" encoding="utf-8"?>\n' + report.tostring()  # type: ignore[no-untyped-call]


def _printable(text: str) -> str:
    """Without the control characters that XML cannot hold."""
    return "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text)
