"""Responses of a calibrated reach to the logged flows: several models, from linear to Saint-Venant."""
