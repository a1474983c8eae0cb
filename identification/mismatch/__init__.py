"""Simulation against recording: locate the mismatch, name the physics, model it, show the fit improve."""
