"""Reading test files: from bytes in any dialect to loops and sweeps in SI."""
