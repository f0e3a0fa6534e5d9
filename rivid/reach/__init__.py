"""Operators, transport and storage of a reach: the flows and levels that follow from the commands."""
