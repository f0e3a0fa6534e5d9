"""rivid: identification of managed river reaches from what their dams log every day."""

__version__ = "0.1.0"
