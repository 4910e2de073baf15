"""Loops in the code of a function: blocks that may come back to themselves."""

from llvmlite import ir


def _followers(function: ir.Function) -> list[list[int]]:
    """Of each block, by its place, the places of those that it may jump to."""
    order = {block.name: place for place, block in enumerate(function.blocks)}
    ends = (() if block.terminator is None else block.terminator.operands for block in function.blocks)
    return [[order[operand.name] for operand in end if isinstance(operand, ir.Block)] for end in ends]


def jumps_back(function: ir.Function) -> bool:
    """Whether some block of a function jumps back to itself or to one before it, as every loop does."""
    return any(then <= place for place, thens in enumerate(_followers(function)) for then in thens)


def has_loop(function: ir.Function) -> bool:
    """Whether some block of a function may come back to itself: those from which nothing leads on are taken away."""
    followers = dict(enumerate(_followers(function)))
    while done := [place for place, thens in followers.items() if followers.keys().isdisjoint(thens)]:
        for place in done:
            del followers[place]
    return bool(followers)
