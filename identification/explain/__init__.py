"""Why simulation and recording differ: rows, samples, fit, search, posterior, locate, discriminate, answer, report."""
