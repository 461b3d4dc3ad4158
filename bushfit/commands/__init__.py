"""Commands as functions that take plain arguments and return a frozen record with the results and result files.

The command line, `batch` and `import bushfit` call the same functions. No function here prints or writes.
"""
