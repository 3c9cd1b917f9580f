"""The dashboard: an app of screens and widgets, fed by a daemon's client."""
