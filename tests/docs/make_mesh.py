"""Leaves a finished mesh on the server HOST, at port 7717, and prints its name: HOST [CA TOKEN]."""

import sys

import stellate

host, *secrets = sys.argv[1:]
credentials = stellate.Credentials(ca=secrets[0], token=secrets[1]) if secrets else None
with stellate.Client(f"{host}:7717", credentials) as client:
    sphere = stellate.manifolds.Sphere()
    info = client.create(sphere, 0.5)
    client.serve(sphere, info.name)
    print(info.name)
