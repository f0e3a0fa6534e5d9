"""Noise of a simulated reach: a state-space model, its Kalman filter, and its fit."""
