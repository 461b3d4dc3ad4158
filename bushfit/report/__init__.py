"""Tables, figures and HTML pages of results, and the results folder that they are written to."""
