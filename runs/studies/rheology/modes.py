#!/usr/bin/env python3
"""Stability of a step of viscoelastic flow by modes: largest amplification of the predictor-corrector of src/flow/material/conformation.h.

One mode of wave number k of density rho: rho u' = -k tau - solvent k^2 u, tau' = -tau + (1 - solvent) k u (relaxation time 1), bdf2. E is the viscosity
that stands for the gain of the stress in the step, of which the explicit part takes the share s (1: smooth modes, less: those that the projection of
the gradient does not see). Prints the largest modulus of an eigenvalue over densities, wave numbers and steps; 1: stable.
"""

import numpy

DENSITIES, STEPS = [0, 1e-6, 1e-3, 0.1, 1, 10], [1e-3, 1e-2, 0.1, 0.5]


def relax(tau, dt, k, modulus, first, last):
    """tau after dt with a velocity linear from first to last."""
    e = numpy.exp(-dt)
    end = (dt - 1 + e) / dt
    return e * tau + modulus * k * (first * (1 - e - end) + last * end)


def amplification(rho, solvent, k, dt, gain, share, extrapolated):
    modulus = 1 - solvent

    def step(state):
        u, before, tau = state
        guess = 2 * u - before if extrapolated else u
        predicted = relax(tau, dt, k, modulus, u, guess)
        new = (rho * (2 * u - 0.5 * before) / dt - k * predicted + gain * k * k * share * guess) / (1.5 * rho / dt + (solvent + gain) * k * k)
        return [new, u, relax(tau, dt, k, modulus, u, new)]

    return abs(numpy.linalg.eigvals(numpy.array([step(e) for e in numpy.eye(3)]).T)).max()


def main():
    print("| solvent | velocity of the predictor | E | s 0 | s 0.5 | s 1 |\n| --- | --- | --- | --- | --- | --- |")
    for solvent in 0, 0.01, 1 / 9, 0.5, 0.59:
        for extrapolated in False, True:
            for name, factor in ("none", 0), ("G dt/2", 0.5), ("G dt", 1):
                worst = []
                for share in 0, 0.5, 1:
                    cases = [(rho, 10.0**p, dt) for rho in DENSITIES for p in numpy.arange(-0.5, 3.5, 0.5) for dt in STEPS if rho + solvent + factor > 0]
                    worst.append(max(amplification(rho, solvent, k, dt, factor * dt * (1 - solvent), share, extrapolated) for rho, k, dt in cases))
                words = "extrapolated" if extrapolated else "u^n"
                print(f"| {solvent:.3g} | {words} | {name} | " + " | ".join(f"{w:.3g}" for w in worst) + " |")


if __name__ == "__main__":
    main()
