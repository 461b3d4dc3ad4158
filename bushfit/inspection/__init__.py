"""Test files looked at before a campaign names them: what they hold, how it was understood, and what is odd."""
