"""Run the landing on all cores with checkpoints, with a coarser camera than the published one.

    python examples/landing_in_parallel.py [FOLDER]

Stop it whenever you like; started again it continues where it was and ends with the same bits.
"""

import os
import sys

from losnav import scenarios
from losnav.campaign import worker_pool


def main(folder: str) -> None:
    landing = scenarios.load("landmark-landing", focal_plane_sigma=5e-6, half_fov=0.7)
    with worker_pool(os.cpu_count() or 1) as pool:
        result = landing.run(runs=300, seed=1, executor=pool, progress=True, out=folder, resume=True)
    for table in result.tables():
        print(table, end="\n\n")
    print(result.claims())


# Worker processes import this file; without this line they would start campaigns of their own.
if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "out/landing")
