"""A fitted model in the files of other programs: solvers, multibody codes, spreadsheets. A file a format."""
