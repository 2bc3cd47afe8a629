"""The commands of `./cell`, by what they are for. Heavy imports wait until one is called."""
