"""A finished run's days joined: posterior-season, and the law of delay and discharge."""
