"""A terrain database as the first version of the schema had it."""

TO_FIRST = """
    DROP TABLE class_physics; ALTER TABLE drive DROP COLUMN frame; UPDATE bevameter_schema SET version_num = '0001'
"""
