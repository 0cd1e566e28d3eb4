"""What all generators of tools/fuzz draw with."""


def power(draw, low, high):
    """A number between 10^low and 10^high."""
    return 10 ** draw.uniform(low, high)


def some(draw, chance):
    return draw.random() < chance
