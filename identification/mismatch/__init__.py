"""Simulation against recording: a room for each question.

- `fit`: the soil, the noise and one set of effects, refitted, and how well they foretell rows held out.
- `locate`: what a fit leaves, and of what it depends.
- `name`: which effects are tried, what speaks against them, how probable each is, and which measurement would tell.
- `show`: the answer in words, tables, figures and pages.

`explain` goes through all four; `explanation` is what it gives.
"""
