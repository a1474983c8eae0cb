"""One set of effects fitted together with the soil and the noise of a recording, and held out."""
