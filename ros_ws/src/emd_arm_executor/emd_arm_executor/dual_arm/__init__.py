"""A second robot, for those who bring their own: two upright arms of seven joints, made up."""
