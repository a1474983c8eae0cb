"""The formats of recordings, one module each, which registers its reader (`readers`)."""
