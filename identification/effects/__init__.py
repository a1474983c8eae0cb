"""Physics and instrument faults that the textbook wheel leaves out, one module an effect (see `catalogue`)."""
