/* ContactCoupling: linear forces between bodies (BodySpring, solve/system.h) in the operators of the system, and in
   what approximates their inverses. The blocks of single bodies in the velocity operator get the ties' parts on the
   diagonal, and the sweep over bodies, nodes, bodies what they do across; more, such as the system of all tied bodies
   there, takes as many iterations and hides motions of whole chains from the tests that end them
   (runs/studies/contact). In the pressure, where a tie makes two bodies move as one along it, the masses of the tied
   bodies are one sparse system with the ties in it, small beside that of the flow: factorised, on several ranks
   iterated over the factors of each (options flow_ties_). */
#pragma once
#include "projection.h"
#include "solve/system.h"

typedef struct _p_ContactCoupling *ContactCoupling;

PetscErrorCode ContactCouplingCreate(Constraint, ContactCoupling *);
PetscErrorCode ContactCouplingDestroy(ContactCoupling *);
/* As FlowSolverSetContactCoupling. Collective. */
PetscErrorCode ContactCouplingSet(ContactCoupling, PetscInt n, const BodySpring spring[]);
/* Are there any, on any rank? Not collective, same on all ranks. */
PetscBool ContactCouplingAny(ContactCoupling);
/* out += scale N R N^T U, with the rigid velocities U of the bodies known here and what to deliver to them in the local
   numbers of the constraint [nlocal][nr], in the units of the scene; others: without the blocks of single bodies.
   Local. */
void ContactCouplingMultAdd(ContactCoupling, PetscBool others, PetscReal scale, const PetscReal U[], PetscReal out[]);
/* Adds the ties to the blocks of own bodies in the velocity operator, of which inverse [nown][nr][nr] is what the name
   says, and makes the system of masses: mass_inverse [nbodies][nr][nr] of M_r/scale; with factors L of that, L L^T, the
   system is Q^{-1} = 1 + L^T N R N^T L/scale, and (M_r + N R N^T)^{-1} = L Q L^T/scale. Blocks in the units of the
   scene; those of known degrees of freedom are left. Collective. */
PetscErrorCode ContactCouplingUpdate(ContactCoupling, PetscReal inverse[], const PetscReal mass_inverse[],
                                     PetscReal scale);
/* Of tied own bodies, from and to the slots: y = L Q L^T x. The others' y stay. Collective. */
PetscErrorCode ContactCouplingSolveMass(ContactCoupling, const PetscReal x[], PetscReal y[]);
/* z = Q z, z [nlocal][nr] by the local numbers of the constraint, the same on all ranks that know a body: the sum of
   the parts that these had at the beginning, which others sum up in between. Both collective. */
PetscErrorCode ContactCouplingSolveBegin(ContactCoupling, const PetscReal partial[]);
PetscErrorCode ContactCouplingSolveEnd(ContactCoupling, PetscReal z[]);
/* As a matrix over u_r. Collective; caller destroys. */
PetscErrorCode ContactCouplingCreateMat(ContactCoupling, Mat *);
