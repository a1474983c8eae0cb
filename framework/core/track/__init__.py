"""Tracks: the vehicle's way over the ground, the places of a wheel along it, its lanes and passes, jumps and holes."""
