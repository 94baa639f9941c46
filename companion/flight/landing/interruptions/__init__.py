"""Events that end or interrupt a phase, one file each.

An event is a row of `preconditions.TABLE` or a check at the head of a phase.

- `gps_loss`: loss of GPS (row PLACE)
- `missing_input`: late scans, maps or positions (row POSITION, check `scans`)
- `crossing`: objects that move over the point (checks `crossing`, `moving_in`)
- `low_battery`
- `late_abort`: lost link, landing modes that come late (`Reactions.checks`)
- `position_jump`
- `withdrawal`: sticks, modes, failsafes and vehicle class (rows CLASS to NO_FAILSAFE, STICKS)
- `velocity_following`: departure from the velocities asked (rows NO_UNASKED_SINK, FOLLOWS)
"""
