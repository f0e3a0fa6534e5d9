"""The reach with its operators in the loop."""
