"""What terminals can and cannot do, and apps that respect it."""
