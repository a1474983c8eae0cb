"""The answer on a page: names and numbers as people read them, tables, pictures, HTML."""
