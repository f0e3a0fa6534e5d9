"""The calibrated model, and what happens when an effect comes in."""
