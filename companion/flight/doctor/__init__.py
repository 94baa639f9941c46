"""`slz doctor`: what of a vehicle is fit for landing with us, what is not, and what to do about it."""
