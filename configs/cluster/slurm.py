"""A Dask scheduler with workers that are jobs of a Slurm cluster: pip install 'rivid[dask]' dask-jobqueue.

    python configs/cluster/slurm.py scheduler.json      (on the login node; it runs until it is interrupted)
    rivid run fleet_logs --config configs/fleet --out out --scheduler scheduler.json

PBSCluster, LSFCluster, SGECluster of dask_jobqueue take the same words. One process, one thread a job slot:
rivid's work is numpy on one core. Every job must see the logs and OUT under the same paths.
"""

import sys
import time

from dask_jobqueue import SLURMCluster
from distributed import Client

if __name__ == "__main__":
    cluster = SLURMCluster(cores=16, processes=16, memory="16GB", walltime="02:00:00")
    cluster.adapt(minimum_jobs=0, maximum_jobs=8)  # as there are tasks
    with Client(cluster) as client:
        client.write_scheduler_file(sys.argv[1])
        while True:
            time.sleep(60)
