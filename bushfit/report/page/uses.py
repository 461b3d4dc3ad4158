"""What a warning means for who uses the numbers: may they be used, and for what."""

import re

#: Of each kind of warning how it is told, a pattern, and what it means; the first that is found counts.
_USES = (
    (r"is that of no rubber|which no rubber does", "Do not use: set the units right first."),
    (r"only agree if", "Do not use before the record is put right: the numbers rest on a test that may be wrong."),
    (r"intervals are invalid", "Values describe the tests, for trends; do not release by the intervals or bands."),
    (r"a model error of", "May be used within the tested range: intervals and bands hold this error."),
    (r"not fitted, and the model misses", "Do not use for this place nearer than the per cent told; test and fit it."),
    (
        r"extrapolated",
        "For estimates only: within the tested range the numbers stand, beyond it neither value nor band is backed.",
    ),
    (
        r"cannot be told from one another|only as a ratio|not determined|these tests do not tell:",
        "Stiffness and loss within the tested range may be used; do not compare one of these parameters alone.",
    ),
    (r"what is known all the same", "This combination may be used and compared, its parameters one by one may not."),
    (
        r"the tests leave .* open|ended at the edge|no different from zero",
        "Stiffness and loss within the tested range may be used; quote no more of this value than is said here.",
    ),
    (
        r"the tests cannot tell what the model lacks|leave other values of the parameters possible",
        "May be used by the whole band, low to high; the value in its middle is no best guess.",
    ),
    (
        r"cannot tell (it|the correction) from|counts as the bushing's",
        "For the car use the whole band, low to high: the value alone takes the bushing's side.",
    ),
    (r"corrected as it was measured", "May be used between the measured points only; not for another part or range."),
    (
        r"the parameters carry that error",
        "Stiffness of this direction may be used; carry the parameters to no other shape or direction without a test.",
    ),
    (r"counts as incompressible", "May be used where the radial stiffness may be too high by this share."),
    (
        r"not fitted; (its|no) band",
        "For a first estimate; test this before a release, as the band is too narrow or missing.",
    ),
    (r"nothing was fitted here", "May be used as far as the values given are known; there is no uncertainty of a fit."),
    (
        r"the model was not fitted here|simulated: the values",
        "Numbers as given, for calculation; they are no test result.",
    ),
    (r"no springpot", "May be used near the frequency of the tests only, for static work; not for dynamic stiffness."),
    (
        r"m and alpha are not known yet",
        "Use model.json, in which all tests are fitted together, in place of this step.",
    ),
    (
        r"belong to the rig and not to the bushing|the predicted stiffness is",
        "May be used for the car; against rig data a difference of this size is no fault.",
    ),
    (r"is the rig's", "Use the band, low to high, which holds both readings."),
    (r"the fit follows them", "Look at these rows first; if they are faults, fit without them before use."),
    (r"left out of the fit", "May be used if these rows are faults of the record; look at them."),
    (
        r"no effect of temperature|degC apart",
        "May be used as a mean of these temperatures only; not for one of them, nor for another.",
    ),
    (r"predicted at 23 degC", "May be used at 23 °C; ask for the temperature of use."),
    (r"as if no larger strain went before", "May be used for a part that was not strained further before."),
    (r"as fully recovered", "May be used for a part that rested; soon after a large strain it is softer."),
    (r"rig's class", "May be used; intervals are as good as this class: repeat a test, or state the class of the rig."),
    (
        r"rests on the m.. given in",
        "May be used as far as this bound is known; the value is the bound, not a test result.",
    ),
    (r"mended by --adopt", "May be used if the records of the tests bear this out; correct the campaign then."),
    (r"more than a rig of this class", "Find out why first: until then the intervals are not backed."),
    (r"varies from row to row", "May be used if this column parts no tests; else name the rows, and fit again."),
    (r"lie beyond .* of the amplitude", "Do not use before the motion of the loop is settled: its loss depends on it."),
    (r"levels disagree", "May be used; what levels differ by is in the intervals."),
    (r"the fit was stopped", "Stiffness and loss may be used; do not quote the parameters that are open."),
    (r"not identifiable from these tests", "May be used; that these effects are absent is not shown."),
    (r"% stiffer than the last", "Numbers are of the rubber after its first strains, as in use; not of a new part."),
    (r"knows no preload", "May be used about this mean only; another preload gives another stiffness."),
    (r"repeat each other lie|it repeats", "May be used no nearer than these repeats differ; find out which is right."),
    (r"are rounded", "May be used; the steps are in the intervals."),
    (r"rows are missing|are used|left out", "May be used; the numbers rest on the part of the record that was kept."),
    (r"are diagnosed", "May be used; the verdict rests on this part of the tests, or on these means."),
)
#: What a warning of no known kind means.
_ELSE = "Settle this before the numbers are used for a release."


def use_of(warning: str) -> str:
    """What a warning means for the use of the numbers, in one sentence."""
    return next((use for pattern, use in _USES if re.search(pattern, warning)), _ELSE)
