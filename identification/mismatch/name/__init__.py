"""Which effects are tried, what speaks for and against them, and how probable each is."""
