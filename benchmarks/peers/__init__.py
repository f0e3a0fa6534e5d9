"""What a user would take instead of `posterior`, side by side with it in one run."""
