"""What the wheel's contact sounds like: microphone and, structure-borne, vibration."""
