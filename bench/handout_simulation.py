"""How well ranks are kept busy that take chunks from one counter, where there are more of them than there are machines.

usage: python bench/handout_simulation.py

Each rank asks, waits for its turn at the counter, for which an answer takes `service`, and for the way there and back,
`way`; then it is busy with its chunk, whose time is spread as those of chaotic members are: lognormal, half its mean
wide. Prints a table of Markdown: what part of the time ranks are busy, from the first chunk to the last.
"""

import heapq
import itertools
import math
import random

CHUNKS_A_RANK = 50
WAY = 5e-6  # s, there and back: of a network that a cluster has
SERVICES = (1e-6, 1e-5)  # s; measured here between processes of one machine: pendula_handout
SPREAD = 0.5


def efficiency(ranks: int, chunk_time: float, service: float, seed: int = 1) -> float:
    """The part of the time that ranks are busy."""
    draw = random.Random(seed)
    sigma = math.sqrt(math.log(1 + SPREAD**2))
    mean = math.log(chunk_time) - sigma**2 / 2
    asking = [(0.0, rank) for rank in range(ranks)]
    free = busy = end = 0.0
    for _ in range(ranks * CHUNKS_A_RANK):
        at, rank = heapq.heappop(asking)
        free = max(at, free) + service
        time = draw.lognormvariate(mean, sigma)
        busy += time
        end = free + WAY + time
        heapq.heappush(asking, (end, rank))
    return busy / (ranks * max(at for at, _ in asking))


def main() -> None:
    """Prints the table."""
    print("| ranks | chunk, s | counter 1 µs | counter 10 µs |\n| --- | --- | --- | --- |")
    for ranks, chunk_time in itertools.product((100, 1000, 10_000), (0.01, 0.1, 1.0)):
        cells = [f"{100 * efficiency(ranks, chunk_time, service):.0f} %" for service in SERVICES]
        print(f"| {ranks} | {chunk_time} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
