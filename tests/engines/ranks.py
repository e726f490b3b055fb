"""Rank 0 hands the questions to the other ranks.

mpirun -n 3 python3 -m mpi4py.futures ranks.py ADDRESS MESH GATE
"""

import sys

import gated
import stellate
from mpi4py.futures import MPIPoolExecutor

if __name__ == "__main__":
    address, name, gate = sys.argv[1:]
    with MPIPoolExecutor() as ranks:
        workers = stellate.executors.workers_on(ranks, gated.Gated(gate), name, 2, server=address)
        print(*workers.wait(), flush=True)
