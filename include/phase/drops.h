/* Drops: particles whose material is a fluid (drops, bubbles), groups of -particle_groups with
   -particle_<group>_material fluid. A drop has a group (density, viscosity, surface tension), a number that it keeps,
   and the volume that it is to have. Where it is the curve of its interface says (curve.h), which belongs to a mesh.

   All ranks know all drops, and do the same with them. The room knows no flow; couple/drops.c ties drops to one.
   Lengths, masses and times in the units of the scene. In the plane, volumes are areas. */
#pragma once
#include "base/expr.h"
#include "base/state.h"
#include "mesh/mesh.h"
#include "phase/contour.h"
#include "phase/interface.h"
#include "shape.h"

typedef struct {
  char      name[64];
  Shape     shape;
  PetscReal density, viscosity, tension;
  PetscReal x[3];    /* of the shape's centroid at the start, */
  PetscReal turn[9]; /* and from the shape's frame to space, as RotationMatrix */
  Expr      region;  /* in place of a shape: negative where the fluid is at the start */
  PetscBool wets;
  PetscReal contact;  /* angle at walls, if it wets them; rad */
  PetscBool never;    /* its drops merge with none */
  PetscReal film;     /* thickness at which films between drops break, 0: that of a cell */
  PetscReal drainage; /* how long drops are neighbours before they merge */
  PetscInt  carries;  /* the first group that carries what this one does, see DropsSetCarried */
} DropGroup;

/* Two drops that are near each other */
typedef struct {
  PetscInt  drop[2];    /* numbers, ascending */
  PetscReal since, gap; /* time, length */
} DropPair;

typedef struct {
  PetscInt  number, group;
  PetscReal target;             /* volume that it is to have */
  PetscReal inside, inside_old; /* volume within bodies that it wets, beside that; one step earlier */
  PhaseSums sums;               /* at the end of the last step; volume: sums.area */
  PetscReal velocity[3];        /* mean over its volume, likewise */
  PetscBool leaves;             /* in this step, through an opening: it is in no interface any more */
  PetscReal flux[3];            /* integral of the velocity over its cells, in the last solve */
} Drop;

typedef struct {
  PetscInt         ngroups, n;
  const DropGroup *group;
  Drop            *drop;           /* [n] ascending numbers */
  PetscInt         numbers;        /* that have been given so far */
  PetscInt         merged, broken; /* events so far */
  PetscInt         vanished;       /* group of a drop that has vanished, -1: none has */
  PetscInt         npair;          /* neighbours in the last step, where drops may stay apart */
  DropPair        *pair;
  PetscReal        time;        /* of that step */
  PetscReal        lost;        /* volume of drops that vanished so far */
  PetscInt         left;        /* that have left through openings so far, */
  PetscReal        left_volume; /* their volume */
  PetscReal        taken;       /* energy of interfaces that events took so far; with drops that left, too */
  PetscReal        shift;       /* largest way along its normals that kept a volume in the last step, cells */
  PhaseInterface   interface;   /* at the end of the last step; nothing before the first */
  const PetscInt  *cell_drop;   /* [cells of the rank, own first] number of its drop, -1; borrowed from couple */
} DropsState;

typedef struct _p_Drops *Drops;

/* Read the options of all such groups; *drops is NULL if there are none. Collective. Errors: no shape, position or
   surface tension, options that contradict each other. */
PetscErrorCode DropsCreate(MPI_Comm, PetscInt dim, Drops *);
PetscErrorCode DropsDestroy(Drops *);
PetscErrorCode DropsGetState(Drops, DropsState **);
PetscErrorCode DropsView(Drops, PetscViewer);
/* The interface at the start, of edges much shorter than h, in a box that it ends at where drops wet walls or are given
   by a region; targets are the volumes in it. Collective. Errors: nothing of a drop is in the box; a region
   reaches over a period. */
PetscErrorCode DropsStart(Drops, const PhaseBox *, PhaseCurve *);
/* In the plane, the radius by which drops of a group swing: of a shape the least of that of a circle of its area and
   how deep its centroid lies, at the start; of a region, of which that is not known, that of a drop whose ellipse
   swings as the longest wave of the box does. Not collective. */
PetscErrorCode DropsGetRadius(Drops, PetscInt group, const MeshLocal *, PetscReal *radius);
/* What a group carries, of another room, is made of the same as what `like` does, an earlier one or itself: drops of
   groups that differ in that are of different fluids. Without it all are alike. Not collective. */
void DropsSetCarried(Drops, PetscInt group, PetscInt like);
/* Do drops wet walls? All of them or none, see DropsCreate. */
PetscBool DropsWet(const DropsState *);
/* In space, where there is no curve of the start, in a box (DropsStartBox, first): signed distances d [n] of x [n][3]
   from what drops are at the start, their closest points y [n][3]; the number of the drop that is nearest to x, and its
   distance; a ball that holds all, and their volume. Not collective. */
PetscErrorCode DropsStartBox(Drops, const PetscReal lower[3], const PetscReal upper[3]);
PetscErrorCode DropsStartDistance(Drops, PetscInt n, const PetscReal x[], PetscReal d[]);
PetscErrorCode DropsStartClosest(Drops, PetscInt n, const PetscReal x[], PetscReal y[]);
PetscErrorCode DropsStartNearest(Drops, const PetscReal x[3], PetscInt *number, PetscReal *d);
PetscErrorCode DropsStartBall(Drops, PetscReal centre[3], PetscReal *radius, PetscReal *volume);
/* pairs.c. May drops meet that are not to merge? */
PetscBool DropsMayStayApart(const DropsState *);
/* Which are neighbours, in the plane: nearer to each other than h, or a film that is thicker. The same on all ranks. */
PetscErrorCode DropsFindPairs(Drops, const PhaseInterface *, PetscReal h, PetscReal time, const PetscReal period[]);
/* Are drops of these numbers not to merge, or not yet? As of the last DropsFindPairs. */
PetscBool DropsAreApart(const DropsState *, PetscInt a, PetscInt b);
/* After a new mesh: `from` is the interface that it was lined up with (nothing: that of the start, in space), `now`
   what it has, whose edges or faces have the number of
   their connected part, 0 to parts - 1, in place of a drop's; volume [parts]. Drops that share a part by descent are
   one event: their targets are added up and shared by volume. number [parts]: the drop that a part is. *changed: others
   than before. Error: parts of two groups have become one. */
PetscErrorCode DropsInherit(Drops, const PhaseInterface *from, const PhaseInterface *now, PetscInt parts,
                            const PetscReal volume[], PetscInt number[], PetscBool *changed);
/* Place of the drop of that number in the state, -1: there is none, as of the number -1 of the fluid around */
static inline PetscInt DropsFind(const DropsState *s, PetscInt number)
{
  for (PetscInt i = 0; i < s->n && number >= 0; i++)
    if (s->drop[i].number == number) return i;
  return -1;
}
/* Energy of the surface of a drop with these sums, less what its wetting of walls gives */
static inline PetscReal DropSurfaceEnergy(const DropGroup *g, const PhaseSums *s)
{
  return g->tension * (s->length - (g->wets ? PetscCosReal(g->contact) * s->wet : 0));
}
/* StateVisit of Drops. */
PetscErrorCode DropsVisitState(void *drops, State);
