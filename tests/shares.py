"""How tests are dealt out to the workers of pytest-xdist."""

from itertools import groupby


def dealt(items, workers):
    """Tests in consecutive shares, as pytest-xdist cuts them."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    modules = [list(own) for _, own in groupby(items, key=lambda item: item.path)]
    heavy = [own for own in modules if own[0].path in slow]
    rest = [item for own in modules if own[0].path not in slow for item in own]
    shares = [[item for own in heavy[k::workers] for item in own] for k in range(workers)]
    for k, share in enumerate(shares):
        left = sum(map(len, shares[k:])) + len(rest)
        lacks = max(0, left // (workers - k) - len(share))
        share += rest[:lacks]
        del rest[:lacks]
    return [item for share in (*shares, rest) for item in share]
