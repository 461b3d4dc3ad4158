"""Commands as functions: each takes plain arguments and returns a frozen record with its results and result files.

The command line, `batch` and `import bushfit` call the same functions. No function here prints or writes.
"""
