"""Figures: functions on matplotlib axes, and the files made of them."""
