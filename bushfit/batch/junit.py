"""The JUnit report of a batch for continuous integration."""

from bushfit.batch.summary import BatchResult
from bushfit.errors import printable


def junit_report(result: BatchResult) -> bytes:
    """Write a JUnit report for continuous integration.

    Args:
        result: results of all parts of the batch.

    Returns:
        XML with an error for a row that failed, and a failure for a limit that is missed or not judged.
    """
    from junitparser import Error, Failure, JUnitXml, TestCase, TestSuite

    suite = TestSuite(result.plan.title)
    for part, record in zip(result.document.parts, result.records, strict=True):
        case = TestCase(printable(part.name), suite.name, record.seconds)
        reasons = [*part.misses.values(), *(part.doubtful.values() if part.result == "not judged" else ())]
        if record.error:
            case.result = [Error(printable(record.error.partition("\n")[0]), "failed")]
            case.result[0].text = printable(record.error, lines=True)
        elif reasons:
            case.result = [Failure(printable("; ".join(reasons)), "limits")]
            case.result[0].text = printable("\n".join(reasons), lines=True)
        suite.add_testcase(case)
    report = JUnitXml("bushfit batch")
    report.add_testsuite(suite)
    report.update_statistics()  # type: ignore[no-untyped-call]
    return b'<?xml version="1.0" encoding="utf-8"?>\n' + report.tostring()  # type: ignore[no-untyped-call]
