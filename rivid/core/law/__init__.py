"""The law of delay and discharge."""
