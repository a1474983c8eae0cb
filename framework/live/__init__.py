"""The main job while the vehicle drives: samples go in one by one, what is believed of the ground comes out at once."""
