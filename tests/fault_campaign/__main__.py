"""The campaign by one command: seeds in, those that fail out, with the way to see each again."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator

from bench.one_thread import ONE_THREAD
from tests.fault_campaign.draw import draw
from tests.fault_campaign.judge import Verdict, tried


def campaign(seeds: Iterable[int], jobs: int) -> Iterator[Verdict]:
    """The verdicts, as they come."""
    if jobs == 1:
        yield from map(tried, seeds)
        return
    with multiprocessing.get_context("spawn").Pool(jobs, maxtasksperchild=2000) as pool:
        yield from pool.imap_unordered(tried, seeds, chunksize=8)


def span(text: str) -> range:
    """`12`, or `0:1000`."""
    first, _, last = text.partition(":")
    return range(int(first), int(last) if last else int(first) + 1)


def main(argv: list[str] | None = None) -> int:
    """Status 1 where a seed failed."""
    parser = argparse.ArgumentParser(prog="tests.fault_campaign", description=__doc__)
    parser.add_argument("--seeds", type=span, default=range(100), metavar="FROM:TO", help="default: 0:100")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="processes (default: %(default)s)")
    parser.add_argument("--show", action="store_true", help="say of each seed what it stands for, and what it came to")
    given = parser.parse_args(argv)
    os.environ.update(ONE_THREAD)
    begun = time.monotonic()
    hows: Counter[str] = Counter()
    failed = 0
    for verdict in campaign(given.seeds, given.jobs):
        hows[verdict.how] += 1
        if given.show:
            print(draw(verdict.seed).text())
            print(f"{verdict.how}: {verdict.cause}")
        if verdict.wrong:
            failed += 1
            print(f"seed {verdict.seed}: {'; '.join(verdict.wrong)}")
            print(f"  again: python -m tests.fault_campaign --seeds {verdict.seed} --show", flush=True)
    seconds = time.monotonic() - begun
    counts = ", ".join(f"{count} {how}" for how, count in hows.most_common())
    print(f"{len(given.seeds)} seeds in {seconds:.0f} s: {counts}; {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
