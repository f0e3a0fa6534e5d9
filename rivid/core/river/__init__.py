"""The probability of a river's travel time."""
