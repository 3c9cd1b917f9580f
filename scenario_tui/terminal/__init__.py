"""Limits of terminals, and apps that respect them."""
