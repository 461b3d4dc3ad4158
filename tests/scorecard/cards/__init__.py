"""The score card: the workflow judged on hidden campaigns."""
