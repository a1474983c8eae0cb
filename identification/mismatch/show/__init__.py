"""The answer in words, tables, figures and pages."""
