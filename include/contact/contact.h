/* Contact: forces between bodies, and between bodies and the walls of the domain. Knows bodies and shapes, not the
   flow.

   Laws (-contact_law), along the line of contact:
     repulsive (default; Glowinski, Pan, Hesla, Joseph 1999; Wan & Turek 2006): zero beyond a range r, quadratic in the
     gap within it, linear in the overlap:
       F(gap) = K ((r - gap)/r)^2 for 0 <= gap < r,   F = K (1 + overlap/(s r)) for overlap > 0, damped in approach
     spring (Cundall & Strack 1979): F = k (r - gap) + c v within the range, c from the coefficient of restitution, with
     Coulomb friction
     none
   and, in addition to either, cohesion (-contact_cohesion; Hamaker 1937, Johnson, Kendall & Roberts 1971, Derjaguin,
   Muller & Toporov 1975, Willett et al. 2000; src/contact/cohesion.c): surfaces touch at the range of the law, from
   where on separations count (pairs that are nearer at the start: there),
   and, in addition to either, -contact_lubrication: the resistance of films thinner than the mesh resolves. Defaults of
   all stiffnesses scale with the cell size and the energy of arrival at terminal speed; see law.c for the formulas.
   Bodies that cannot move exert forces and receive them, two such bodies ignore each other. */
#pragma once
#include "bodies/bodies.h"
#include "base/border.h"
#include "base/state.h"

typedef struct _p_Contact *Contact;

/* ---- set up: couple, run ---- */

/* h: cell size near the bodies (default range h/2). rho_f: density of the fluid, whose added mass counts; 0 without.
   walls: bit mask of solid sides of the box, bit 2*axis for lower, 2*axis + 1 for upper; others by ContactSetWalls.
   Collective. Errors: no scale for the stiffness of a spring. */
PetscErrorCode ContactCreate(Bodies, PetscReal h, PetscReal rho_f, const PetscReal gravity[3], const PetscReal lower[3],
                             const PetscReal upper[3], PetscInt walls, Contact *);
/* Walls that are no sides of a box, and how walls move. border: its solid pieces are walls, numbered from
   CONTACT_SIDES on after the sides of the box; NULL: there are none. side: the boundaries of the border that are sides
   of the box, -1: not one of them. velocity: that of a boundary (one of the border) at a position of it; NULL: all
   stand still. Borrowed, all of them. Before the first step. Not collective. */
#define CONTACT_SIDES 6
typedef struct {
  Border   border;
  PetscInt side[CONTACT_SIDES];
  PetscErrorCode (*velocity)(void *context, PetscInt boundary, const PetscReal x[3], PetscReal v[3]);
  void *context;
} ContactWalls;
PetscErrorCode ContactSetWalls(Contact, const ContactWalls *);
/* Length of the domain in its periodic directions, 0 in the others (default): bodies meet across such faces. Not
   collective. */
PetscErrorCode ContactSetPeriod(Contact, const PetscReal period[3]);
/* Dynamic viscosity of the film between bodies, for -contact_lubrication (default 0). Not collective. */
PetscErrorCode ContactSetViscosity(Contact, PetscReal viscosity);
/* On the mesh a film in space resists as one that is wider by the recess, in -contact_lubrication_range (default 0).
   With a recess films of up to twice that range get what the mesh lacks of them; less in steps below h^2/nu, nothing
   below .18 of it. Before the first step. Not collective. */
PetscErrorCode ContactSetFilmGapOffset(Contact, PetscReal offset);
/* Gravity from now on, where it changes in time; speed scales stay those of the gravity at creation. Not collective. */
PetscErrorCode ContactSetGravity(Contact, const PetscReal gravity[]);
/* Refuse bodies whose centre is outside the domain, and those that overlap a wall or another body in their present
   position, of which one at least can move away: names body, position, the other and the overlap. Not collective. */
PetscErrorCode ContactCheckStart(Contact);
PetscErrorCode ContactDestroy(Contact *);
PetscErrorCode ContactView(Contact, PetscViewer);

/* ---- where packed bodies start: run, before all else ---- */

/* What packing did: bodies that were packed, the sum of the shares of their boxes that their groups fill. */
typedef struct {
  PetscInt  bodies, sweeps;
  PetscReal fraction, seconds;
} ContactPacking;

/* Find positions for the bodies of the groups that are packed (bodies.h: Packing): no overlaps with any body, gaps of
   at least their margins, inside of their boxes or across the faces of axes with a period (else 0) that their box
   spans. All others stay. To be called right after BodiesCreate or BodiesCreateLocal: the same positions on any number
   of ranks. Collective. Error: they do not fit. */
PetscErrorCode ContactPack(Bodies, const PetscReal lower[3], const PetscReal upper[3], const PetscReal period[3],
                           ContactPacking *);

/* ---- a step in a flow: run (ContactKeep to ContactFinishStep), couple and solve (the springs) ---- */

/* Take steps back: Keep before ContactStep, Revert after it; contact_force, contact_torque, gap and the tangential
   springs are what they were. Not collective. */
PetscErrorCode ContactKeep(Contact);
PetscErrorCode ContactRevert(Contact);
/* Before a step dt in a flow: bodies that are spread go to their owners, and are known where they may meet others or be
   drawn in it; k then stands for others. a [n][3]: acceleration as for ContactStep, attached to the bodies; NULL: none.
   The list of pairs is rebuilt. Nothing happens where all know all. Collective. */
PetscErrorCode ContactMigrate(Contact, PetscReal dt, PetscReal (*a)[3]);
/* A force at a touch of bodies i and j (j < 0: a wall), for the end of a step: value - rate v along the normal, which
   points from j to i, v the speed at which they part there; ri, rj from their centres (0: it acts there). */
typedef struct {
  PetscInt  i, j;
  PetscReal value, rate, normal[3], ri[3], rj[3];
  PetscBool turns, again; /* bonds: it turns the bodies about the normal; it joins the same two as the one before */
} ContactSpring;
/* In place of ContactStep, for a flow that is solved with the contact: all forces of the step [t, t + dt] (spring.c),
   where contact_force and contact_torque are zero until ContactTakeForces has been told what they came to, force [n].
   a as for ContactStep, for the scales of bodies without buoyancy; start: bodies will have gathered the speed dt a.
   Owned by the contact, until the next call. Of bodies that are spread pairs are found on every rank that owns one of
   the two. Collective. */
PetscErrorCode ContactFindSprings(Contact, PetscReal dt, PetscBool start, PetscReal (*a)[3], PetscInt *n,
                                  const ContactSpring *spring[]);
PetscErrorCode ContactTakeForces(Contact, const PetscReal force[]);
/* Contact force to use for the step [t, t + dt]: sub-steps the bodies from their present state under the frozen
   remaining acceleration a, alpha [n][3] (their motion without contact: a = (U^n - U^{n-1})/dt - contact_force of the
   last step / ContactGetMass, alpha alike), with the effective mass and inertia of ContactGetMass, and stores force and
   torque in contact_force, contact_torque of the state. Repulsive law: the force of a pair is its mean over the step,
   or over a look-ahead of two steps where that is larger (step.c says why). The state itself does not move. Bodies out
   of range of everything cost nothing but the search. Collective, ghosts as their owners. Safe while a body moves
   at most h in a step. Error when -contact_substeps is given and too small for the stiffness: names option, value and
   the needed number. */
PetscErrorCode ContactStep(Contact, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3]);
/* Are forces of this law to be solved with the flow (-contact_coupling)? */
PetscErrorCode ContactIsImplicit(Contact, PetscBool *);
/* Do bodies attract each other (-contact_cohesion)? Not collective, the same on all ranks. */
PetscBool ContactHasCohesion(Contact);
/* What the scheme of a flow makes of a force of contact and of velocities (law spring: impulse.c).
   weight: c_t dt, with du/dt = c_t u^{n+1} - d. theta: a body moves by theta u^{n+1} + (1 - theta) u^n.
   implicit: bodies and flow are solved together, and springs count (ContactGetSprings); else a body has its own mass
   alone when contact pushes it, and its added mass acts later. */
typedef struct {
  PetscReal weight, theta;
  PetscBool implicit;
} ContactScheme;
/* For the next step, before ContactGetMass and ContactStep. Nothing happens with other laws. Not collective. */
PetscErrorCode ContactSetScheme(Contact, const ContactScheme *);
/* After ContactStep: springs for the system of flow and bodies, in addition to contact_force, as ContactFindSprings has
   them. Owned by the contact. Not collective. */
PetscErrorCode ContactGetSprings(Contact, PetscInt *n, const ContactSpring *spring[]);
/* After the bodies have moved in the flow: fills gap of the state (PETSC_MAX_REAL: far) and, with
   -contact_remove_overlap, moves bodies that overlap apart (separate.c says why and how) until 1e-3 radii are left;
   velocities stay. Collective, same bits on any number of ranks. */
PetscErrorCode ContactFinishStep(Contact);
/* Effective mass of body k: (rho_s + rho_f) Vol in 2D, (rho_s + rho_f/2) Vol in 3D (added mass of a disc, a sphere),
   and effective inertia (rho_s + rho_f/10) times the inertia for unit density (space axes, as BodiesGetInertia; NULL:
   not wanted). The caller of ContactStep must use these for a and alpha: another inertia makes the loop of flow and
   contact unstable. */
PetscErrorCode ContactGetMass(Contact, PetscInt k, PetscReal *mass, PetscReal inertia[6]);
/* Mean acceleration [length/time^2] of body k, which is free and starts at rest, over a step of length dt: weight less
   buoyancy on the effective mass, with the least drag that a viscous fluid has on a body of its volume (Stokes' on a
   sphere; on a disc 3 viscosity a length and speed, which is that with walls 160 diameters away). In creeping flow a
   step is long beside the time in which a body gathers its speed. Not collective. */
PetscErrorCode ContactGetStart(Contact, PetscInt k, PetscReal dt, PetscReal a[3]);

/* ---- a step without a flow: run ---- */

/* Move the bodies of the state by dt under contact, gravity and buoyancy alone, without a flow: symplectic Euler in as
   many sub-steps as the stiffness asks for. Fills u_old, w_old (the velocities before), contact_force, contact_torque
   (means over the step), gap (smallest). Memory besides the state: some 100 bytes a body. Errors as ContactStep. */
PetscErrorCode ContactAdvanceAlone(Contact, PetscReal dt);

/* ---- what it has found: report, run ---- */

/* Mean force and torque of contact on body k over the last step: contact_force and contact_torque but for the
   scheme's weight. *touched: how far what the flow did to it in that step answers an impulse of law
   spring (0 to 1; not of films alone); NULL: not wanted. */
PetscErrorCode ContactGetMean(Contact, PetscInt k, PetscReal force[3], PetscReal torque[3], PetscReal *touched);
/* Energy stored in the contacts at the present position of the bodies, and the work that contact has done on the bodies
   since the beginning (negative: lost or stored): stored + work = minus what damping and friction took. In a flow the
   work is counted by ContactCountWork, called after the bodies have moved by dt. Not collective. */
PetscErrorCode ContactCountWork(Contact, PetscReal dt);
PetscErrorCode ContactGetEnergy(Contact, PetscReal *stored, PetscReal *work);
/* Range of the contact law: gaps beyond it are free. */
PetscErrorCode ContactGetRange(Contact, PetscReal *range);
#define CONTACT_SUBSTEP 0.1 /* length of a sub-step, in the time in which a contact force changes */
/* The name of the boundary that a wall is part of. Borrowed. */
PetscErrorCode ContactGetWallName(Contact, PetscInt wall, const char **name);
/* Work of the last call: pairs of bodies tested by their bounding circles (0: the list of pairs was still good), pairs
   and walls within reach, sub-steps of the step. Each may be NULL. */
PetscErrorCode ContactGetWork(Contact, PetscInt *tests, PetscInt *pairs, PetscInt *substeps);
/* Largest overlap, in diameters of the smaller body, that ContactFinishStep has found since the beginning. */
PetscErrorCode ContactGetSeparation(Contact, PetscReal *overlap);
/* Contacts of the present positions: pairs of permanent numbers i < j (j < 0: wall number -1 - j, see
   ContactGetWallName), i of an own body, whose gap is below the range, where they are nearest and the direction from
   j to i; ascending in i, then j. *link [*n] is the caller's to free. None with law none. Bodies that are spread may
   go to their owners. Collective. */
typedef struct {
  PetscInt  i, j;
  PetscReal gap, x[3], normal[3];
} ContactLink;
PetscErrorCode ContactGetLinks(Contact, PetscInt *n, ContactLink *link[]);

/* ---- checkpoint ---- */

/* StateVisit of a Contact: the list of pairs with their tangential springs, the work done. */
PetscErrorCode ContactVisitState(void *contact, State);
