"""Which rows of a recording count: gate, settling, standstill, duplicates, units and signs, noise."""
