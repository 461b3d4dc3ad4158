"""The JUnit report of a batch for continuous integration."""

from bushfit.batch.summary import BatchResult


def junit_report(result: BatchResult) -> bytes:
    """Write a JUnit report for continuous integration.

    Args:
        result: of the batch.

    Returns:
        XML with an error for a row that failed, and a failure for a limit that is missed or not judged.
    """
    from junitparser import Error, Failure, JUnitXml, TestCase, TestSuite

    suite = TestSuite(result.plan.title)
    for part, record in zip(result.document.parts, result.records, strict=True):
        case = TestCase(_printable(part.name), suite.name, record.seconds)
        reasons = [*part.misses.values(), *(part.doubtful.values() if part.result == "not judged" else ())]
        if record.error or reasons:
            text = _printable(record.error or "\n".join(reasons))
            line = text.partition("\n")[0] if record.error else "; ".join(text.splitlines())
            outcome = Error(line, "failed") if record.error else Failure(line, "limits")
            outcome.text = text
            case.result = [outcome]
        suite.add_testcase(case)
    report = JUnitXml("bushfit batch")
    report.add_testsuite(suite)
    report.update_statistics()  # type: ignore[no-untyped-call]
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + report.tostring()  # type: ignore[no-untyped-call]


def _printable(text: str) -> str:
    """Text without control characters, which XML cannot hold."""
    return "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text)
