"""The pilot's page: what the companion sees, in any browser on the drone's network, and orders back.

It runs in a thread with an event loop of its own and takes nothing but what the companion leaves on a
`Board`.
"""
