"""What may be named, what is tied with it, and whether it holds."""
