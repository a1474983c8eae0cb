"""What a fit leaves: on which channel, against which variable, and what smooth correction it asks for."""
