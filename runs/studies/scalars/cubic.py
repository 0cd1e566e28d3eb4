"""Effective conductivity of cubic arrays of spheres over that of what is between them: Sangani & Acrivos 1983.

cubic.py ARRAY RATIO FRACTION, ARRAY one of sc, bcc, fcc
"""

import sys

COEFFICIENTS = {
    "sc": (1.3047, 0.2305, 0.4054, 0.0723, 0.1526, 0.0105),
    "bcc": (0.1290, -0.41286, 0.76421, 0.2569, 0.0113, 0.00562),
    "fcc": (0.07529, 0.69657, -0.74100, 0.0420, 0.0231, 9.14e-7),
}


def effective(array, ratio, f):
    c1, c2, c3, c4, c5, c6 = COEFFICIENTS[array]
    L = [0.0] + [(ratio - 1) / (ratio + 2 * i / (2 * i - 1)) for i in range(1, 6)]
    below = -1 / L[1] + f + c1 * L[2] * f ** (10 / 3) * (1 + c2 * L[3] * f ** (11 / 3)) / (1 - c3 * L[2] * f ** (7 / 3))
    below += c4 * L[3] * f ** (14 / 3) + c5 * L[4] * f**6 + c6 * L[5] * f ** (22 / 3)
    return 1 - 3 * f / below


if __name__ == "__main__":
    print(effective(sys.argv[1], float(sys.argv[2]), float(sys.argv[3])))
