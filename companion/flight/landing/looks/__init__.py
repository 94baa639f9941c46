"""Looks at the landing point from other places than above it, before the descent."""
