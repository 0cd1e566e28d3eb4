/* CoupleDrops: drops and bubbles in the flow, as a participant of the step (participant.h).

   A drop is an aligned particle whose inside stays fluid. The mesh is lined up with the interface in every step, cells
   belong to a phase by their centre (density and viscosity by cell, symmetric stress), and the discontinuous pressure
   takes the jump exactly. The nodes of the lined-up edges (in space faces) are the interface and move with the flow;
   between two meshes it is their curve (phase/curve.h) or sheet (phase/sheet.h).

   A step begins with the interface predicted: nodes X of the last mesh go to X + corr + dt (3 u^n - u^(n-1))/2, corr =
   theta dt (u^n - u*) what the last solve added to its prediction, u* the extrapolated velocity; theta is 0.6, in steps
   of first order 1. Every drop then gets its volume back by a shift along the normals, and the mesh is lined up. So it
   does at the end of the step, after the solve: displacements keep areas to first order only.

   Old velocities are taken at the feet of the trajectories, within 3 cells of the interface, fading to the node itself
   at 6; the convection has the velocity of the nodes, as the scheme differentiates (FlowSetMeshVelocity). At a fixed
   place the gradient of the velocity jumps as the interface passes, and values taken there are wrong by the step.

   Surface tension is -sigma (grad_s X, grad_s v) on the edges, the Laplace-Beltrami form (Dziuk 1990), implicit in what
   the step adds: theta dt sigma (grad_s (u - u*), grad_s v) (Baensch 2001), which has no limit of stability. */
#pragma once
#include "align/align.h"
#include "alignkept.h"
#include "couple/couple.h"
#include "mesh/remap.h"
#include "phase/drops.h"
#include "phase/surfaces.h"

/* Side of the box that drops may wet */
typedef struct {
  PetscInt  boundary;
  PetscReal slip_length; /* 0: free slip */
  PetscReal pull[3];     /* of this step at contact lines in own cells, on the fluids */
} DropWall;

typedef struct CoupleDrops {
  Drops         drops;
  DropsState   *s;
  PhaseSurfaces surfaces;
  /* that the mesh is lined up with, or will be in this step; nothing: not yet, or (in space) with what drops are at the
     start */
  PhaseInterface interface;
  PetscBool      lined_up; /* once at least; until then the first mesh is being made */
  Align          align;
  AlignResult    result;
  Remap          remap;
  PetscBool      first_order; /* the last step was */
  PetscBool     *closed;      /* [ncell] too near to a rigid body for a drop; NULL: there are none */
  PetscBool      meets;       /* there are bodies that drops wet */
  PetscInt       met;         /* 1: drops know what of them is inside of these, and 1 for every drawing beside them */
  PetscReal     *angle;       /* [groups of bodies] contact angle, 0: not wetted */
  PetscReal      steps;       /* -couple_drops_steps, and the longest step that it stands */
  PetscReal      longest;
  PetscBool      regular;                          /* -couple_drops regularised: no mesh is lined up (dropregular.c) */
  PetscInt      *by_middle;                        /* [ncell_all] then: the drop that the middle of a cell is in, -1 */
  PetscInt       nband, band_capacity, *band_cell; /* and local cells near the interface, ascending, */
  PetscReal     *band; /* [nband][nb][nb] int delta (P grad phi_i) . (P grad phi_j), P along it */
  /* [ncell_all] the part of a drop's cell that is its own: beside bodies that it wets, what is in none; where the
     interface is regularised its mean; NULL: all */
  PetscReal *fraction;
  PetscInt  *side;                /* [nnode_all] walls that drops may wet: bits 2 axis + (upper one) */
  DropWall  *wall;                /* [6] of these */
  PetscInt  *cell_drop;           /* [ncell_all] number of the drop, of any share; -1: the fluid around */
  PetscReal *density, *viscosity; /* [ncell_all] */
  /* [nnode_all][dim]: displacement of the fluid in this step, on the mesh before it; what the last solve added; x - y
     of the last step, y the foot of x; velocity of the nodes */
  PetscReal *way, *corr, *shift, *velocity;
  PetscReal *force; /* [nnode_all][dim] */
  PetscReal *load;  /* [nnode_all][dim] gravity on what bodies take the place of; NULL: there are none that drops wet */
  PetscReal (*weight_of_bodies)[6]; /* [bodies] what they give back of it, force and torque */
  PetscReal *weight;                /* [nnode_all] diagonal of the terms */
  PetscInt   nterm, term_capacity, *term_cell;
  PetscReal *term; /* [nterm][nb][nb] */
  AlignKept *kept; /* from DropsKeepMesh to DropsArrive: velocities of two times, corr, shift; else NULL */
} CoupleDrops;

/* dropenergy.c. What viscosity takes, of all cells, and what is the scheme's of the work of tension. After the solve.
   Collective. */
PetscErrorCode DropsAddLosses(CoupleDrops *, Couple, CoupleLosses *);
/* dropbodies.c. Which cells are closed, by bodies where they are at the end of the step. Not collective. */
PetscErrorCode DropsCloseCells(CoupleDrops *, Couple);
/* Error: at the start a body that is not wetted overlaps a drop in part. Collective. */
PetscErrorCode DropsCheckOverlap(const CoupleDrops *, Couple);
/* dropmeet.c. Contact angles of bodies. Not collective. */
PetscErrorCode DropsReadAngles(CoupleDrops *, Couple);
/* Error: at the start a body that is wetted lies across a wall that is no mirror. Collective. */
PetscErrorCode DropsCheckMirrors(const CoupleDrops *, Couple);
/* The predicted interface ends on bodies that are wetted, as they are at the end of the step. Collective. */
PetscErrorCode DropsMeetBodies(CoupleDrops *, Couple);
/* After bodies have been drawn: their parts of cells, in the density and in the volumes of drops. Collective. */
PetscErrorCode DropsTakeBodies(CoupleDrops *, Couple);
/* Gravity on what bodies take the place of, on nodes inside, and its opposite in the rows of the bodies, which are
   filled. Collective. */
PetscErrorCode DropsLoadBodies(CoupleDrops *, Couple);
/* After the forces on bodies have been found: these are without that. Local. */
PetscErrorCode DropsAddForces(CoupleDrops *, Couple);
/* What the energy of surfaces is more than tension times length where bodies are wetted: less what of the interface is
   inside of them, and tension times cosine of the angle for what of their surface is in a drop. And the power of
   DropsLoadBodies. After the solve. Collective. */
PetscErrorCode DropsAddEnergyOfBodies(const CoupleDrops *, Couple, CouplePower *);
/* After the drops. Collective. */
PetscErrorCode DropsVisitBodies(CoupleDrops *, State);
/* dropapart.c. And which between drops that stay apart. After DropsCloseCells. Collective. */
PetscErrorCode DropsKeepApart(CoupleDrops *, Couple);
/* The thickness of films, when there is a mesh. Collective. Error: they are too thick for it. */
PetscErrorCode DropsSetFilm(CoupleDrops *, Couple);
/* dropwalls.c. Which walls drops may wet. Collective. Error: they wet walls, and there are none. */
PetscErrorCode DropsFindWalls(CoupleDrops *, Couple);
/* Of a local cell with nodes xc: into M [nb][nb], friction of walls with a slip length beside it; into f->force, the
   pull of the wall on the contact line of a drop in an own cell. */
void DropsAddFriction(const CoupleDrops *, const MeshLocal *, PetscInt cell, const PetscReal xc[], PetscReal M[]);
void DropsAddPull(CoupleDrops *, const MeshLocal *, PetscInt cell, const PetscReal xc[]);
/* Slots of side e of a cell, first to last along it (in space a lattice of 3 x 3); how many there are */
PetscInt DropsSideSlots(PetscInt dim, PetscInt e, PetscInt slot[]);
/* Force of walls that drops wet on the fluids, of surface tension and friction, which the walls are told. After the
   solve. Collective. */
PetscErrorCode DropsBalanceWalls(const CoupleDrops *, Couple, const PetscReal u[], PetscReal sum[3]);
/* Is there friction beside this cell? */
PetscBool DropsHasFriction(const CoupleDrops *, const MeshLocal *, PetscInt cell);
/* Does local node i, of a cell of a drop, lie on the interface: is it of a cell of the fluid around too? */
static inline PetscBool DropsIsInterface(const MeshLocal *l, const PetscInt cell_drop[], PetscInt i)
{
  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++)
    if (cell_drop[l->node_cell[q]] < 0) return PETSC_TRUE;
  return PETSC_FALSE;
}
/* Is the side of a cell with middle node i one of the domain? */
static inline PetscBool DropsIsBoundary(const MeshLocal *l, PetscInt i)
{
  return (PetscBool)(l->node_cell_ptr[i + 1] - l->node_cell_ptr[i] == 1);
}
/* Weight of the present velocity in the way of the interface */
static inline PetscReal DropsTheta(const FlowStep *s)
{
  return s->order == 1 ? 1 : 0.6;
}
/* droplimit.c. f->longest, on the first mesh. Not collective. */
PetscErrorCode DropsFindLongest(CoupleDrops *, Couple);
/* *dt becomes no larger than the drops stand. Collective. */
PetscErrorCode DropsLimitStep(CoupleDrops *, Couple, PetscReal *dt);
/* dropmesh.c. Where the interface will be at the end of the step. Collective. */
PetscErrorCode DropsPredict(CoupleDrops *, Couple);
/* Every drop of the interface gets its volume back by a shift along its normals, or some of it; *way: the largest,
   cells */
PetscErrorCode DropsKeepVolumes(CoupleDrops *, Couple, PhaseInterface *, PetscReal *way);
/* The mesh lined up with it, its cells' drops, density and viscosity. Collective. Error: it cannot be lined up. */
PetscErrorCode DropsAlign(CoupleDrops *, Couple);
/* n parts of the interface `now`, whose pieces have their numbers in place of a drop's: which drops they are, number
   [n]; after events the step begins anew. Collective. Error: there is none any more. */
PetscErrorCode DropsName(CoupleDrops *, Couple, PetscInt n, const PhaseInterface *now, PetscInt number[]);
/* The mesh is lined up with f->interface, which moves no node yet; its cells' drops when they have. Collective. */
PetscErrorCode DropsLineUp(CoupleDrops *, Couple);
PetscErrorCode DropsNameCells(CoupleDrops *, Couple);
/* dropregular.c, in place of DropsAlign: the curve drawn anew, its drops, what of cells they are. Collective. */
PetscErrorCode DropsRegularise(CoupleDrops *, Couple);
/* Fractions of cells, and those near the interface, of the interface as it is. Not collective. */
PetscErrorCode DropsFindFractions(CoupleDrops *, Couple);
/* Error: what the regularised form has not. Collective. */
PetscErrorCode DropsCheckRegular(CoupleDrops *, Couple);
/* dropcurve.c. Of the interface and its images, the point closest to x [dim], as seen from there, nearer than reach
   (edge -1: there is none, and d is reach). Not collective. */
void DropsNearest(const PhaseInterface *, const MeshLocal *, const PetscReal x[], PetscReal reach, PhasePoint *);
/* Of the drop that x [dim] is in or nearest to, with its images: its number, the signed distance of its interface, in
   space at the start of what it is; -1: there is none, and that is PETSC_MAX_REAL. Not collective. */
PetscErrorCode DropsFindDeepest(const CoupleDrops *, const MeshLocal *, const PetscReal x[], PetscInt *number,
                                PetscReal *depth);
/* A copy of the curve, its nodes moved by way [nnode_all][dim] as the mesh has it there. Collective. */
PetscErrorCode DropsMoveCurve(CoupleDrops *, Couple, const PetscReal way[], PhaseCurve *);
/* Of velocities u, synced, the mean over every drop: by the flux through its interface, int u_a = int x_a u.n, since
   cells near it have other fluid too. Collective. */
PetscErrorCode DropsMeanVelocities(CoupleDrops *, Couple, const PetscReal u[]);
/* After DropsLineUp, of a mesh that has its velocities, of a checkpoint or where cells were rebuilt: nodes go to their
   places. Collective. */
PetscErrorCode DropsPlaceNodes(CoupleDrops *, Couple);
PetscErrorCode DropsSetProperties(CoupleDrops *, Couple);
/* Nodes xc [nb][dim] of a local cell as the interface has them, moved by way [nnode_all][dim] (NULL: not) */
PetscErrorCode DropsCellCoordinates(const CoupleDrops *, Couple, PetscInt cell, const PetscReal way[], PetscReal xc[]);
/* The interface as the mesh has it, its nodes moved by way [nnode_all][dim] (NULL: not). Collective. */
PetscErrorCode DropsGather(CoupleDrops *, Couple, const PetscInt cell_drop[], const PetscReal way[], PhaseInterface *);
/* dropsheet.c. The same in space. */
PetscErrorCode DropsGatherSheet(CoupleDrops *, Couple, const PetscInt cell_drop[], const PetscReal way[], PhaseSheet *);
/* K [9][9] = sigma (grad_s phi_i, grad_s phi_j) over a face with nodes x */
void DropsFaceMatrix(PetscReal sigma, PetscReal x[9][3], PetscReal K[9][9]);
/* dropleave.c. Name of the opening that the whole side 2 axis + (upper one) is, NULL: it is none; *out: fluid goes out
   there at x. Collective. */
PetscErrorCode DropsFindOpening(Couple, PetscInt side, const PetscReal x[3], const char **name, PetscBool *out);
/* Drops of the interface `now`, that of f->interface a step later, which have come to an opening leave it; told.
   Collective. */
PetscErrorCode DropsLetLeave(CoupleDrops *, Couple, PhaseInterface *now);
/* dropcause.c. Error: the mesh cannot be lined up, and why. Collective. */
PetscErrorCode DropsStop(CoupleDrops *, Couple);
/* Error: a drop is so far off its volume that its run means nothing, and why. After DropsAccept. Collective. */
PetscErrorCode DropsCheckVolumes(CoupleDrops *, Couple);
/* On the first mesh: what of the drops' volume [parts] is not that of their shapes becomes their target, and is told.
   Collective. Error: a group has no cell. */
PetscErrorCode DropsCheckStart(CoupleDrops *, Couple, PetscInt parts, const PetscReal volume[],
                               const PetscInt number[]);
/* dropparts.c. part [ncell_all]: number of the connected part of the cells that are in the surface, -1: none. *n: how
   many there are. Collective. */
PetscErrorCode DropsFindParts(Couple, const PetscInt cell_surface[], PetscInt part[], PetscInt *n);
/* dropfeet.c. Old velocities for the nodes of result, which are moved by the caller: node [*n], value [*n][2][dim], the
   caller's to free (PetscFree2), and the velocity of the nodes. Collective. */
PetscErrorCode DropsCarry(CoupleDrops *, Couple, PetscInt *n, PetscInt *node[], PetscReal *value[]);
/* droptension.c. Matrix and force of the surface tension, given to the flow. */
PetscErrorCode DropsAssemble(CoupleDrops *, Couple);
/* The interface at the end of the step of velocities u, and the sums of all drops there. Collective. */
PetscErrorCode DropsMeasure(CoupleDrops *, Couple, const PetscReal u[]);
/* What such a step adds, and DropsMeasure. Collective. */
PetscErrorCode DropsAccept(CoupleDrops *, Couple, const PetscReal u[]);
/* dropremesh.c. Error: something that meshes which follow do not work with. */
PetscErrorCode DropsCheckRemesh(const CoupleDrops *, Couple);
/* Before cells are rebuilt: what goes over to the new mesh. Then the new mesh is lined up with the interface as it was,
   and has the old velocities. Collective. Error: that of DropsCheckRemesh. */
PetscErrorCode DropsKeepMesh(CoupleDrops *, Couple);
PetscErrorCode DropsArrive(CoupleDrops *, Couple, Mesh *old);
