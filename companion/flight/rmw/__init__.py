"""ROS 2 middleware without a ROS installation: keys, tokens and messages as rmw_zenoh writes them."""
