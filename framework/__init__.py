"""What ties the parts together: fusion, the traverse, synthetic scenarios and the command line."""
