"""What a calibrated reach does to the logged flows: several descriptions, and which is rich enough."""
