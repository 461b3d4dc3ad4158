"""Export a fitted model to other programs: solvers, multibody codes, spreadsheets. One module per format."""
