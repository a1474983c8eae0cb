"""A recorded drive and the readers that open it."""
