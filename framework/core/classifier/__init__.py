"""The classifier that camera, microphone and vibration share, and what it is trained on."""
