#!/usr/bin/env python3
"""Makes designs/scan_example.csv: a scan of designs/seed_air.toml as a gaussmeter might give it.

Coil 4 is 3 % stronger and coil 5 is 2 % weaker than designed, the sensor sits 0.4 mm to the right of
and 0.7 mm above where it says, the earth's field is there, and every value has 2 uT of noise.
Usage: scripts/scan_example.py FLUXFORM > designs/scan_example.csv
"""

import csv
import io
import random
import subprocess
import sys

GAINS = {4: 1.03, 5: 0.98}
SHIFT_M = (0.0004, 0.0, 0.0007)
EARTH_T = (12e-6, -9e-6, -41e-6)
NOISE_T = 2e-6
CURRENT_A = 1.5


def main():
    random.seed(7)
    read = [(x / 1e3, y / 1e3, z / 1e3) for z in (12, 20, 33) for y in (-13, 0, 17) for x in (-11, 4, 19, 38)]
    true = [tuple(p + s for p, s in zip(point, SHIFT_M)) for point in read]
    table = "x_m,y_m,z_m\n" + "".join(f"{x!r},{y!r},{z!r}\n" for x, y, z in true)
    command = [sys.argv[1], "probe", "designs/seed_air.toml", "-", "--quiet"]
    reported = subprocess.run(command, input=table, text=True, capture_output=True, check=True).stdout
    rows = list(csv.DictReader(io.StringIO(reported)))
    print("x_m,y_m,z_m,coil,current_a,bx_t,by_t,bz_t")
    for coil, gain in GAINS.items():
        for point, row in zip(read, (row for row in rows if row["coil"] == str(coil))):
            field = [
                gain * CURRENT_A * float(row[f"b{axis}_t_per_a"]) + earth + random.gauss(0.0, NOISE_T)
                for axis, earth in zip("xyz", EARTH_T)
            ]
            print(*(f"{x:.4f}" for x in point), coil, CURRENT_A, *(f"{b:.8f}" for b in field), sep=",")


main()
