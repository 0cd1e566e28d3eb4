"""What all generators of tools/fuzz draw with, and what several judge by."""

MOMENTUM, MOMENTUM_FAST = 0.05, 0.3  # as the program itself judges: share of the largest force


def power(draw, low, high):
    """A number between 10^low and 10^high."""
    return 10 ** draw.uniform(low, high)


def some(draw, chance):
    return draw.random() < chance
