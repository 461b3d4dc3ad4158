"""What `export` is asked for wrongly, a command line a row, and what the one error has to say."""

# fmt: off
EXPORTS = [
    ("export|model.json", "Missing option '--format'"),
    ("export|model.json|--format|catia", "'catia' is not one of 'fmu', 'nastran', 'abaqus', 'adams', 'csv', 'xlsx'"),
    ("export|model.json|--format|nastran|--units|mm kg s N", "--units: kg times mm/s^2 is 0.001 N, and not one N", 'try: such as "mm t s N"'),
    ("export|model.json|--format|nastran|--units|mm", "--units: a unit is missing", 'found: "mm"'),
    ("export|model.json|--format|xlsx|--units|mm t s bar", '--units: "bar" is none of the four units'),
    ("export|model.json|--format|csv|--dialect|optistruct", "'--dialect' is of '--format nastran'."),
    ("export|model.json|--format|nastran|--dialect|msc", "'msc' is not 'optistruct'"),
    ("export|model.json|--format|csv|--accuracy|0 %", "--accuracy: this is not positive"),
    ("export|model.json|--format|csv|--accuracy|1", "--accuracy: a number without a unit"),
    ("export|model.json|--format|csv|--frequencies|5:155 Hz", "--frequencies: these are no values with a unit"),
    ("export|model.json|--format|csv|--amplitudes|1 Hz", "--amplitudes: the unit does not fit"),
    ("export|model.json|--format|adams|--direction|sideways", "no such direction or specimen", "found: sideways"),
    ("export|model.json|--format|csv|--campaign|lost.toml", "lost.toml: there is no such file"),
    ("export|lost.json|--format|csv", "lost.json: there is no such file", 'did you mean "model.json"?'),
    ("export|campaign.toml|--format|csv", "campaign.toml: a fitted model is needed", "found: a campaign"),
]
