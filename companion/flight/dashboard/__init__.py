"""Pilot's web page: shows the companion's state in any browser on the drone's network, and sends orders back.

It runs in a thread with an event loop of its own and reads only what the companion writes to a `Board`.
"""
